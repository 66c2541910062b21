"""Who commands, and why a ROS peer's commands do not drive: what it cannot see, since ROS has no word for it. Pure.

A peer of ours knows the rules. One that publishes on `cmd_vel` with ROS's tools does not, and sees the robot stand.
"""

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median

from lira.hal.clock import AHEAD_S

KEPT_S = 3.0  # what is older says nothing of now
RECENT_S = 10.0  # so long somebody is one that commands
MOST = 64  # of commands and of peers that are remembered
ENOUGH = 3
INSISTENT_HZ = 5.0
SLOW = (
    "commands on '{key}' come {rate_hz:.1f} times a second and each counts for {timeout_s:g} s, so the robot stops in "
    "between: publish 10 or more a second (teleop_twist_keyboard: --ros-args -p repeat_rate:=10.0)"
)
OFF = (
    "the stamps on '{key}' are {lag_s:.2f} s {way} the robot's clock, so nothing there counts: set both clocks "
    "(chrony), or publish Twist, which has none"
)
ZERO_FIRST = "'{key}' carries motion, but the robot waits for a zero: publish one first, as after every stop"


@dataclass(frozen=True, slots=True)
class Noted:
    """A command of a ROS peer: when it came, how old its stamp was then (None without one), whether it moves."""

    at_s: float
    age_s: float | None
    moves: bool


@dataclass(slots=True)
class _Stream:
    """What one peer says on one key."""

    timeout_s: float
    noted: deque[Noted] = field(default_factory=lambda: deque(maxlen=MOST))


class CommandWatch:
    """Fed by the thread that moves the wheels, read by the one that reports. No lock: the first waits for nobody.

    Copies of dictionaries and deques are whole, since nothing runs in between that makes one.
    """

    def __init__(self) -> None:
        self._streams: dict[tuple[str, str], _Stream] = {}
        self._commanded_s: dict[str, float] = {}

    def note_sender(self, sender: str, now_s: float) -> None:
        """Somebody commands; `sender` is the id of the session, "" if it is not known."""
        self._commanded_s.pop(sender, None)
        self._commanded_s[sender] = now_s
        if len(self._commanded_s) > MOST:
            del self._commanded_s[next(iter(self._commanded_s))]

    def note_ros(self, key: str, sender: str, timeout_s: float, noted: Noted) -> None:
        """A ROS peer commands on a topic, where each command counts for `timeout_s`."""
        if len(self._streams) >= MOST and (key, sender) not in self._streams:
            del self._streams[next(iter(self._streams))]
        self._streams.setdefault((key, sender), _Stream(timeout_s)).noted.append(noted)

    def commanders(self, now_s: float) -> frozenset[str]:
        """The sessions that commanded lately."""
        return frozenset(sender for sender, at_s in self._commanded_s.copy().items() if now_s - at_s < RECENT_S)

    def advice(self, now_s: float, *, armed: bool) -> tuple[str, ...]:
        """What to tell those whose commands do not drive now, each with the remedy."""
        copied = self._streams.copy()
        streams = [(key, stream.timeout_s, list(stream.noted.copy())) for (key, _), stream in copied.items()]
        told = (_advice(key, timeout_s, noted, now_s, armed=armed) for key, timeout_s, noted in streams)
        return tuple(dict.fromkeys(each for each in told if each))


def _advice(key: str, timeout_s: float, noted: list[Noted], now_s: float, *, armed: bool) -> str:
    recent = [each for each in noted if now_s - each.at_s < KEPT_S]
    if len(recent) < ENOUGH or not any(each.moves for each in recent):
        return ""
    ages_s = [each.age_s for each in recent if each.age_s is not None]
    if len(ages_s) == len(recent) and (min(ages_s) >= timeout_s or max(ages_s) < -AHEAD_S):
        lag_s = median(ages_s)
        return OFF.format(key=key, lag_s=abs(lag_s), way="behind" if lag_s > 0.0 else "ahead of")
    gap_s = median(after.at_s - before.at_s for before, after in pairwise(recent))
    if gap_s > timeout_s:
        return SLOW.format(key=key, rate_hz=1.0 / gap_s, timeout_s=timeout_s)
    if not armed and gap_s < 1.0 / INSISTENT_HZ and all(each.moves for each in recent):
        return ZERO_FIRST.format(key=key)
    return ""
