"""A client's estimate of the robot's clock, from the times that messages carry. Wall clocks are not trusted."""

from collections import deque

# Long enough for one prompt message among late ones, short enough to follow a robot whose time runs slower.
WINDOW_S = 0.25
# An estimate of another's clock lags. A stamp further ahead than this is not honest, and could keep what is old alive.
AHEAD_S = 0.1


class ClockEstimate:
    """Pure: every time comes in as an argument, `local_s` on this machine's monotonic clock.

    The most prompt message of the last moments sets the offset, so the estimate is late by the shortest delay and a
    command stamped with it never looks younger than it is. It never runs back.
    """

    def __init__(self) -> None:
        self._offsets: deque[tuple[float, float]] = deque()
        self._latest_s = float("-inf")

    @property
    def known(self) -> bool:
        """Whether the robot was ever heard."""
        return bool(self._offsets)

    def note(self, sent_s: float, local_s: float) -> None:
        """A message that the robot sent at `sent_s` came at `local_s`."""
        self._offsets.append((local_s, sent_s - local_s))
        while self._offsets[0][0] < local_s - WINDOW_S:
            self._offsets.popleft()

    def restart(self) -> None:
        """Forget all: the robot was started anew and its clock with it."""
        self._offsets.clear()
        self._latest_s = float("-inf")

    def now(self, local_s: float) -> float:
        """Seconds on the robot's clock at `local_s`; only when `known`."""
        self._latest_s = max(self._latest_s, local_s + max(offset_s for _, offset_s in self._offsets))
        return self._latest_s


def is_fresh(stamp_s: float, now_s: float, max_age_s: float) -> bool:
    """Whether what was captured at `stamp_s` counts at `now_s`. Never with a stamp that is not finite.

    Far ahead is no better than too old: such a stamp is of another clock, or of this one before it started anew, and
    would stay fresh for too long.
    """
    return -AHEAD_S <= now_s - stamp_s <= max_age_s
