"""The robot's clock: how it is told on the bus, and a client's estimate of it from the times that messages carry.

On the bus it counts from 1970, as ROS expects: what is added to it is measured once, when the robot starts, so it still
runs evenly and never back, whatever is done to the time of day. Clients trust no wall clock.
"""

import time
from collections import deque
from collections.abc import Callable
from operator import itemgetter

# A clock that shows this much counts from 1970 already: no machine is up for thirty years.
COUNTS_FROM_1970_S = 1e9
TRIES = 5
WINDOW_S = 0.25  # long enough for one prompt message among late ones
RATE_S = 1.0  # over so long it is measured how fast the robot's time passes
# An estimate of another's clock lags. A stamp further ahead than this is not honest, and could keep what is old alive.
AHEAD_S = 0.1
LEAP_S = 0.5  # a clock that runs as ours or slower never leaps; a link that was slow from the first on gains no more
# So long a robot is silent before another of its name is listened to: one that was started anew, and nobody who speaks
# between its words. Both take longer to come up.
SILENT_S = 0.3
HEAL_S = 1.0  # if nothing else is heard for so long, it was no mistake: the robot's clock was set


def unix_offset_s(now: Callable[[], float], unix: Callable[[], float] = time.time) -> float:
    """Return what has to be added to a robot's clock to count from 1970: 0 for one that does already.

    Of a few tries the one counts in which the least time passed between two looks.
    """
    if now() > COUNTS_FROM_1970_S:
        return 0.0
    tries = []
    for _ in range(TRIES):
        before_s, unix_s, after_s = now(), unix(), now()
        tries.append((after_s - before_s, unix_s - (before_s + after_s) / 2))
    return min(tries)[1]


class TimeBase:
    """What a session adds to its own times when it tells them, and takes off those that it hears: 0 but for a robot."""

    def __init__(self) -> None:
        self.offset_s = 0.0

    @property
    def offset_ns(self) -> int:
        """The same in nanoseconds."""
        return round(self.offset_s * 1e9)


OWN_TIME = TimeBase()


class ClockEstimate:
    """Pure: every time comes in as an argument, `local_s` on this machine's monotonic clock.

    The most prompt message of the last moments sets the offset, so the estimate is late by the shortest delay and a
    command stamped with it never looks younger than it is. It never runs back, so a time that leaps ahead of all before
    is not taken at once: one such message would hold the estimate for ever. Between messages it goes on as fast as the
    robot's time was measured to pass, but no faster than ours: a twin may be slowed down, or too slow for its machine.

    `even`: it passes as ours does. For who lets commands expire by the estimate: there, and only there, one that slows
    down is the unsafe side, and delays that grow look like a slow clock.
    """

    def __init__(self, *, even: bool = False) -> None:
        self._even = even
        self._offsets: deque[tuple[float, float]] = deque()
        self._rate = 1.0
        self._latest_s = float("-inf")
        self._highest_s = float("inf")  # offset ever since the start
        self._believed_s = float("-inf")
        self._epoch: int | None = None  # of the robot that is listened to
        self._heard_s = float("-inf")

    @property
    def known(self) -> bool:
        """Whether the robot was ever heard."""
        return bool(self._offsets)

    @property
    def epoch(self) -> int | None:
        """The session of the robot that is listened to, None before any was heard."""
        return self._epoch

    def hear(self, epoch: int, sent_s: float, local_s: float) -> bool:
        """As `note`, for a message that names its sender's session. False if it is not of the robot listened to.

        A robot that was started anew has another session, and another clock.
        """
        if epoch != self._epoch:
            if local_s - self._heard_s < SILENT_S:
                return False
            self._epoch = epoch
            self.restart()
        self._heard_s = local_s
        self.note(sent_s, local_s)
        return True

    def note(self, sent_s: float, local_s: float) -> None:
        """A message that the robot sent at `sent_s` came at `local_s`."""
        offset_s = sent_s - local_s
        if offset_s > self._highest_s + LEAP_S:
            if local_s - self._believed_s < HEAL_S:
                return
            self.restart()
        self._believed_s = local_s
        self._highest_s = offset_s if self._highest_s == float("inf") else max(self._highest_s, offset_s)
        self._offsets.append((local_s, offset_s))
        while self._offsets[0][0] < local_s - RATE_S:
            self._offsets.popleft()
        if not self._even:
            self._rate = self._measured(local_s)

    def restart(self) -> None:
        """Forget all: the robot was started anew and its clock with it."""
        self._offsets.clear()
        self._rate = 1.0
        self._latest_s, self._highest_s = float("-inf"), float("inf")

    def now(self, local_s: float) -> float:
        """Seconds on the robot's clock at `local_s`; only when `known`."""
        behind = 1.0 - self._rate
        newest_s = self._offsets[-1][0]
        # Slower only while it is heard: what was heard last grows old as fast as ours once it is silent.
        followed_s = min(local_s, newest_s + WINDOW_S)
        self._latest_s = max(
            self._latest_s,
            *(
                local_s + offset_s - behind * (followed_s - heard_s)
                for heard_s, offset_s in self._offsets
                if heard_s >= newest_s - WINDOW_S
            ),
        )
        return self._latest_s

    def _measured(self, local_s: float) -> float:
        """How fast the robot's time passes, at most 1, by the most prompt messages of now and of the beginning.

        Delays that grow make it too slow, which is the safe side.
        """
        began_s = self._offsets[0][0]
        span_s = min(WINDOW_S, 0.5 * (local_s - began_s))
        then_s, then = max((each for each in self._offsets if each[0] <= began_s + span_s), key=itemgetter(1))
        now_s, now = max((each for each in self._offsets if each[0] >= local_s - span_s), key=itemgetter(1))
        if now_s <= then_s:
            return 1.0
        return min(1.0, max(0.0, 1.0 + (now - then) / (now_s - then_s)))


def is_fresh(stamp_s: float, now_s: float, max_age_s: float) -> bool:
    """Whether what was captured at `stamp_s` counts at `now_s`. Never with a stamp that is not finite.

    Far ahead is no better than too old: such a stamp is of another clock, or of this one before it started anew, and
    would stay fresh for too long.
    """
    return -AHEAD_S <= now_s - stamp_s <= max_age_s
