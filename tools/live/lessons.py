"""Which layouts are taught and proven on a twin: what the novice could not do is taught next. Pure."""

from collections import deque
from collections.abc import Iterable, Sequence

from lira.fusion.log.run_log import LapRecord
from lira.hal.messages import Phase


class Lessons:
    """Layouts in their order: `layout` is taught next, `taught` was last. The `own` one comes first; those of other
    days were `seen`.

    A layout is taught until a lap on it was passed. Then comes the next on which the novice failed its exam, and when
    there is none left, one that nobody has seen. Before the first exam there is but the own one.
    """

    def __init__(self, own: int, seen: Iterable[int] = ()) -> None:
        self.layout = self.taught = own
        self._unseen = max(own, *seen, own) + 1
        self._failed: deque[int] = deque()
        self._examined = False

    def draw(self, count: int) -> Sequence[int]:
        """So many layouts that nobody has seen; from now on somebody has."""
        first, self._unseen = self._unseen, self._unseen + count
        return range(first, self._unseen)

    def note_lap(self, *, passed: bool) -> None:
        """A lap was taught on `layout`."""
        self.taught = self.layout
        if passed and self._examined:
            self.layout = self._failed.popleft() if self._failed else self.draw(1)[0]

    def note_proof(self, laps: Sequence[LapRecord]) -> None:
        """Take in which layouts the novice failed on, alone."""
        failed = [lap.layout for lap in laps if lap.phase == Phase.UNSEEN and not lap.passed]
        self._examined |= any(lap.phase == Phase.UNSEEN for lap in laps)
        if failed:
            self.layout, *rest = failed
            self._failed = deque(rest)
