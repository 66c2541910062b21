"""Whether a person's hand is on the controls, as the robot itself says."""

import time

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED
from lira.hal.messages import Source


class Hand:
    """Hears who drives."""

    def __init__(self, watch: Bus) -> None:
        self._applied = watch.reader(APPLIED)

    @property
    def holds(self) -> bool:
        """Whether a hand drives now."""
        newest = self._applied.newest()
        if newest is None or time.monotonic() - newest.arrived_s > APPLIED.max_age_s:
            return False
        return newest.message.source is Source.TELEOP
