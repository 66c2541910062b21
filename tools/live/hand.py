"""Whether a person's hand is on the controls, as the robot itself says."""

import time

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED
from lira.hal.messages import Applied, Source


class Hand:
    """Hears who drives."""

    def __init__(self, watch: Bus) -> None:
        self._applied = watch.reader(APPLIED)

    @property
    def holds(self) -> bool:
        """Whether a hand drives now."""
        newest = self._applied.newest()
        return newest is not None and is_by_hand(newest.message, time.monotonic() - newest.arrived_s)


def is_by_hand(applied: Applied, age_s: float) -> bool:
    """Whether a hand drives, as it was told so long ago."""
    return applied.source is Source.TELEOP and age_s <= APPLIED.max_age_s
