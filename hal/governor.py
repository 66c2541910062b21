"""The governor: what the wheels get, from whom, and why. Pure: no threads, no clock, no bus.

| state | event | becomes | because |
|---|---|---|---|
| stopped | a neutral command of who is in charge | armed | ok |
| stopped | a motion command | stopped | neutral first |
| armed | a valid command | armed | ok |
| any | who is in charge went silent in motion, or nobody is left | stopped | stale |
| any | a command that is not finite | stopped | refused |
| any | told to halt | stopped | no command |

Teleop is in charge while its hand is on, else policy. A hand goes off by saying so (`released`) or by going silent
after a neutral command; if it goes silent in motion, the robot stops and policy does not take over. A released hand
holds the robot at zero until policy commands, and no longer than its time-out.
"""

import math
from collections import Counter
from dataclasses import replace
from enum import StrEnum

from hal.messages import STOP, Applied, Command, Reason, Source, Twist
from hal.profile import RobotProfile

NEUTRAL_LIMIT = 1e-6  # below this, in m/s and rad/s, a command is neutral
ROUNDING_S = 1e-6  # stamps travel in whole nanoseconds; sums of periods are less exact than that
# The watchdog strikes at the time-out. A command that comes late by less than its own period is obeyed if the watchdog
# has not struck: without this a stream at exactly the time-out would hang on rounding.
GRACE_S = 0.02
# A client's estimate of the robot's clock lags; one that runs this far ahead could keep a late command alive.
AHEAD_S = 0.1


class State(StrEnum):
    """Whether motion is allowed."""

    STOPPED = "stopped"
    ARMED = "armed"


class Event(StrEnum):
    """What can happen to the governor."""

    NEUTRAL = "neutral"  # who is in charge commands zero
    MOTION = "motion"  # who is in charge commands motion
    EXPIRED = "expired"  # who was in charge went silent
    BROKEN = "broken"  # a command that is not finite
    IGNORED = "ignored"  # a command that came late or out of order
    HALTED = "halted"  # the robot is being shut down


TRANSITIONS: dict[tuple[State, Event], tuple[State, Reason]] = {
    (State.STOPPED, Event.NEUTRAL): (State.ARMED, Reason.OK),
    (State.STOPPED, Event.MOTION): (State.STOPPED, Reason.NEUTRAL_FIRST),
    (State.STOPPED, Event.EXPIRED): (State.STOPPED, Reason.STALE),
    (State.STOPPED, Event.BROKEN): (State.STOPPED, Reason.REFUSED),
    (State.STOPPED, Event.IGNORED): (State.STOPPED, Reason.REFUSED),
    (State.STOPPED, Event.HALTED): (State.STOPPED, Reason.NO_COMMAND),
    (State.ARMED, Event.NEUTRAL): (State.ARMED, Reason.OK),
    (State.ARMED, Event.MOTION): (State.ARMED, Reason.OK),
    (State.ARMED, Event.EXPIRED): (State.STOPPED, Reason.STALE),
    (State.ARMED, Event.BROKEN): (State.STOPPED, Reason.REFUSED),
    (State.ARMED, Event.IGNORED): (State.ARMED, Reason.OK),
    (State.ARMED, Event.HALTED): (State.STOPPED, Reason.NO_COMMAND),
}


class Governor:
    """Arbitrates, limits and times out commands. Every time is on the robot's clock.

    `refused` counts refused commands by reason.
    """

    def __init__(self, profile: RobotProfile) -> None:
        base, control = profile.base, profile.control
        self._limits = (base.max_linear_m_s, base.max_angular_rad_s)
        self._timeouts_s = {Source.TELEOP: control.teleop_timeout_s, Source.POLICY: control.policy_timeout_s}
        self._live: dict[Source, Command] = {}
        self._newest_s: dict[Source, float] = {}
        self._state, self._reason = State.STOPPED, Reason.NO_COMMAND
        self.refused: Counter[str] = Counter()

    @property
    def state(self) -> State:
        """Whether motion is allowed now."""
        return self._state

    def submit(self, command: Command, now_s: float) -> None:
        """Take a command, or refuse and count it. It drives from the next `tick` on."""
        self._expire(now_s, GRACE_S)
        if objection := self._objection(command, now_s):
            self.refused[objection] += 1
            self._fire(Event.IGNORED)
        elif not _is_finite(command.twist):
            self.refused["not finite"] += 1
            self._live.pop(command.source, None)
            # A broken policy does not take the wheel out of a person's hand.
            if not self._hand_on():
                self._fire(Event.BROKEN)
        else:
            self._accept(command, now_s)

    def tick(self, now_s: float) -> Applied:
        """Let time-outs strike and return what the wheels get now."""
        self._expire(now_s, -ROUNDING_S)
        command = self._in_charge()
        answers = -1 if command is None else command.answers
        age_s = math.nan if command is None else now_s - command.stamp_s
        if self._state is State.STOPPED or command is None:
            return Applied(STOP, now_s, Source.NONE, self._reason, (), answers, age_s)
        twist, clamps = self._clamp(command.twist)
        return Applied(twist, now_s, command.source, self._reason, clamps, answers, age_s)

    def halt(self) -> None:
        """Stop and forget every command."""
        self._live.clear()
        self._fire(Event.HALTED)

    def _fire(self, event: Event) -> None:
        self._state, self._reason = TRANSITIONS[self._state, event]

    def _objection(self, command: Command, now_s: float) -> str | None:
        timeout_s = self._timeouts_s.get(command.source)
        if timeout_s is None:
            return "no source"
        if not math.isfinite(command.stamp_s):
            return "no time"
        if command.stamp_s > now_s + AHEAD_S:
            return "from the future"
        if command.stamp_s < self._newest_s.get(command.source, -math.inf):
            return "out of order"
        if now_s - command.stamp_s >= timeout_s - ROUNDING_S:
            return "late"
        return None

    def _accept(self, command: Command, now_s: float) -> None:
        self._newest_s[command.source] = command.stamp_s
        twist = STOP if command.released else command.twist
        command = replace(command, twist=twist, stamp_s=min(command.stamp_s, now_s))
        self._live[command.source] = command
        if self._in_charge() is command:
            self._fire(Event.NEUTRAL if is_neutral(twist) else Event.MOTION)

    def _expire(self, now_s: float, grace_s: float) -> None:
        """Drop what is older than its time-out. Stop if that was a hand in motion, or the last one."""
        stop = False
        for source, timeout_s in self._timeouts_s.items():
            command = self._live.get(source)
            if command is None or now_s - command.stamp_s < timeout_s + grace_s:
                continue
            del self._live[source]
            stop |= not self._live or (source is Source.TELEOP and not is_neutral(command.twist))
        if stop:
            self._fire(Event.EXPIRED)

    def _in_charge(self) -> Command | None:
        teleop, policy = self._live.get(Source.TELEOP), self._live.get(Source.POLICY)
        return teleop if self._hand_on() or policy is None else policy

    def _hand_on(self) -> bool:
        teleop = self._live.get(Source.TELEOP)
        return teleop is not None and not teleop.released

    def _clamp(self, twist: Twist) -> tuple[Twist, tuple[str, ...]]:
        wanted = (twist.linear_m_s, twist.angular_rad_s)
        got = [min(max(value, -limit), limit) for value, limit in zip(wanted, self._limits, strict=True)]
        names = [name for name, a, b in zip(("linear", "angular"), wanted, got, strict=True) if a != b]
        return Twist(*got), tuple(names)


def is_neutral(twist: Twist) -> bool:
    """Whether a command asks for no motion at all."""
    return abs(twist.linear_m_s) < NEUTRAL_LIMIT and abs(twist.angular_rad_s) < NEUTRAL_LIMIT


def _is_finite(twist: Twist) -> bool:
    return math.isfinite(twist.linear_m_s) and math.isfinite(twist.angular_rad_s)
