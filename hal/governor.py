"""The governor: what the wheels get, from whom, and why. Pure: no threads, no clock, no bus.

`TRANSITIONS` is the whole state machine. In words: only a neutral command arms, only an armed robot moves, whatever
goes wrong stops it, the emergency stop holds until it is released, and then a neutral command has to come again.

Teleop is in charge while its hand is on, else policy. A hand goes off by saying so (`released`); if it goes silent
instead, the robot stops and policy does not take over. A released hand holds the robot at zero until policy commands,
and no longer than its time-out.
"""

import math
from collections import Counter
from dataclasses import replace
from enum import StrEnum

from hal.field import Clearance, limit_speed
from hal.lease import Lease, session_of
from hal.messages import STOP, Applied, Command, Reason, Source, Twist
from hal.profile import RobotProfile

NEUTRAL_LIMIT = 1e-6  # below this, in m/s and rad/s, a command is neutral
ROUNDING_S = 1e-6  # stamps travel in whole nanoseconds; sums of periods are less exact than that
# The watchdog strikes at the time-out. A command that comes late by less than its own period is obeyed if the watchdog
# has not struck: without this a stream at exactly the time-out would hang on rounding.
GRACE_S = 0.02
# A client's estimate of the robot's clock lags; one that runs this far ahead could keep a late command alive.
AHEAD_S = 0.1
RAMP_S = 0.05  # the speed limit never rises by more than this much time's worth at once, however long nobody looked


class State(StrEnum):
    """Whether motion is allowed."""

    DISARMED = "disarmed"  # nobody has commanded, or the commander left
    ARMED = "armed"
    STOPPED = "stopped"  # something went wrong
    EMERGENCY = "emergency"  # somebody pressed the emergency stop


class Event(StrEnum):
    """What can happen to the governor."""

    NEUTRAL = "neutral"  # who is in charge commands zero
    MOTION = "motion"  # who is in charge commands motion
    EXPIRED = "expired"  # who was in charge went silent
    BROKEN = "broken"  # a command that is not finite
    IGNORED = "ignored"  # a command that came late, out of order or from somebody else
    HALTED = "halted"  # the robot is being shut down, or the commander left
    PRESSED = "pressed"  # the emergency stop
    RELEASED = "released"  # the emergency stop


_D, _A, _S, _E = State.DISARMED, State.ARMED, State.STOPPED, State.EMERGENCY
TRANSITIONS: dict[tuple[State, Event], tuple[State, Reason]] = {
    (_D, Event.NEUTRAL): (_A, Reason.OK),
    (_D, Event.MOTION): (_D, Reason.NEUTRAL_FIRST),
    (_D, Event.EXPIRED): (_D, Reason.STALE),
    (_D, Event.BROKEN): (_D, Reason.REFUSED),
    (_D, Event.IGNORED): (_D, Reason.REFUSED),
    (_D, Event.HALTED): (_D, Reason.NO_COMMAND),
    (_D, Event.PRESSED): (_E, Reason.ESTOP),
    (_D, Event.RELEASED): (_D, Reason.NEUTRAL_FIRST),
    (_A, Event.NEUTRAL): (_A, Reason.OK),
    (_A, Event.MOTION): (_A, Reason.OK),
    (_A, Event.EXPIRED): (_S, Reason.STALE),
    (_A, Event.BROKEN): (_S, Reason.REFUSED),
    (_A, Event.IGNORED): (_A, Reason.OK),
    (_A, Event.HALTED): (_D, Reason.NO_COMMAND),
    (_A, Event.PRESSED): (_E, Reason.ESTOP),
    (_A, Event.RELEASED): (_A, Reason.OK),
    (_S, Event.NEUTRAL): (_A, Reason.OK),
    (_S, Event.MOTION): (_S, Reason.NEUTRAL_FIRST),
    (_S, Event.EXPIRED): (_S, Reason.STALE),
    (_S, Event.BROKEN): (_S, Reason.REFUSED),
    (_S, Event.IGNORED): (_S, Reason.REFUSED),
    (_S, Event.HALTED): (_D, Reason.NO_COMMAND),
    (_S, Event.PRESSED): (_E, Reason.ESTOP),
    (_S, Event.RELEASED): (_S, Reason.NEUTRAL_FIRST),
    (_E, Event.NEUTRAL): (_E, Reason.ESTOP),
    (_E, Event.MOTION): (_E, Reason.ESTOP),
    (_E, Event.EXPIRED): (_E, Reason.ESTOP),
    (_E, Event.BROKEN): (_E, Reason.ESTOP),
    (_E, Event.IGNORED): (_E, Reason.ESTOP),
    (_E, Event.HALTED): (_E, Reason.ESTOP),
    (_E, Event.PRESSED): (_E, Reason.ESTOP),
    (_E, Event.RELEASED): (_S, Reason.NEUTRAL_FIRST),
}


class Governor:
    """Arbitrates, limits and times out commands. Every time is on the robot's clock.

    `refused` counts refused commands by reason. `clearance` is what the lidar saw last; it matters only to a profile
    with a protective field.
    """

    def __init__(self, profile: RobotProfile) -> None:
        base, control = profile.base, profile.control
        self._limits = (base.max_linear_m_s, base.max_angular_rad_s)
        self._ramps = (base.max_acceleration_m_s2, base.max_angular_acceleration_rad_s2)
        self._field = profile.field
        self._timeouts_s = {Source.TELEOP: control.teleop_timeout_s, Source.POLICY: control.policy_timeout_s}
        self._leases = {source: Lease(control.lease_s) for source in self._timeouts_s}
        self._live: dict[Source, Command] = {}
        self._newest_s: dict[Source, float] = {}
        self._state, self._reason = State.DISARMED, Reason.NO_COMMAND
        self._last, self._last_s = STOP, -math.inf
        self.clearance: Clearance | None = None
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
        twist, source, reason = STOP, Source.NONE, self._reason
        clamps: tuple[str, ...] = ()
        if self._state is State.ARMED and command is not None:
            source = command.source
            twist, clamps = self._limit(command.twist, now_s)
            if "field_stop" in clamps or "field_blind" in clamps:
                reason = Reason.OBSTACLE
        self._last, self._last_s = twist, now_s
        if command is None:
            return Applied(twist, now_s, source, reason, clamps)
        age_s = now_s - command.stamp_s
        session = session_of(command.epoch)
        return Applied(
            twist, now_s, source, reason, clamps, command.answers, age_s, session, command.seq, command.commander
        )

    def halt(self) -> None:
        """Stop and forget every command."""
        self._live.clear()
        self._fire(Event.HALTED)

    def press(self) -> None:
        """Stop until `release`, and forget every command."""
        self._live.clear()
        self._fire(Event.PRESSED)

    def release(self, now_s: float) -> None:
        """Let go of the emergency stop. What was commanded before does not count any more."""
        self._live.clear()
        self._newest_s = dict.fromkeys(self._timeouts_s, now_s)
        self._fire(Event.RELEASED)

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
        return self._leases[command.source].objection((command.commander, command.epoch), now_s)

    def _accept(self, command: Command, now_s: float) -> None:
        source, lease = command.source, self._leases[command.source]
        self._newest_s[source] = command.stamp_s
        lease.renew((command.commander, command.epoch), now_s)
        twist = STOP if command.released else command.twist
        command = replace(command, twist=twist, stamp_s=min(command.stamp_s, now_s))
        self._live[source] = command
        if self._in_charge() is command:
            self._fire(Event.NEUTRAL if is_neutral(twist) else Event.MOTION)
        if command.released:
            lease.release()
            if source is Source.POLICY:
                self._leave()

    def _leave(self) -> None:
        """Policy is gone; a person's hand stays."""
        del self._live[Source.POLICY]
        if not self._live:
            self._fire(Event.HALTED)

    def _expire(self, now_s: float, grace_s: float) -> None:
        """Drop what is older than its time-out. Stop if that was a hand that did not let go, or the last one."""
        stop = False
        for source, timeout_s in self._timeouts_s.items():
            command = self._live.get(source)
            if command is None or now_s - command.stamp_s < timeout_s + grace_s:
                continue
            del self._live[source]
            stop |= not self._live or (source is Source.TELEOP and not command.released)
        if stop:
            self._fire(Event.EXPIRED)

    def _in_charge(self) -> Command | None:
        teleop, policy = self._live.get(Source.TELEOP), self._live.get(Source.POLICY)
        return teleop if self._hand_on() or policy is None else policy

    def _hand_on(self) -> bool:
        teleop = self._live.get(Source.TELEOP)
        return teleop is not None and not teleop.released

    def _limit(self, wanted: Twist, now_s: float) -> tuple[Twist, tuple[str, ...]]:
        """Cut to the profile's limits, then to what the field allows, then to what can be reached by now."""
        pair = (wanted.linear_m_s, wanted.angular_rad_s)
        linear, angular = (min(max(value, -limit), limit) for value, limit in zip(pair, self._limits, strict=True))
        clamps = [name for name, a, b in zip(("linear", "angular"), pair, (linear, angular), strict=True) if a != b]
        if self._field is not None:
            linear, cut = limit_speed(self._field, self.clearance, linear, now_s)
            clamps += [cut] if cut else []
        passed_s = min(now_s - self._last_s, RAMP_S)
        before = (self._last.linear_m_s, self._last.angular_rad_s)
        ramped = Twist(*map(_ramp, (linear, angular), before, self._ramps, (passed_s, passed_s)))
        clamps += ["acceleration"] if ramped != Twist(linear, angular) else []
        return ramped, tuple(clamps)


def _ramp(wanted: float, before: float, limit: float | None, passed_s: float) -> float:
    """Speed up no faster than the limit; slowing down is never held up."""
    if limit is None:
        return wanted
    start = abs(before) if wanted * before > 0.0 else 0.0
    return math.copysign(min(abs(wanted), start + limit * passed_s), wanted)


def is_neutral(twist: Twist) -> bool:
    """Whether a command asks for no motion at all."""
    return abs(twist.linear_m_s) < NEUTRAL_LIMIT and abs(twist.angular_rad_s) < NEUTRAL_LIMIT


def _is_finite(twist: Twist) -> bool:
    return math.isfinite(twist.linear_m_s) and math.isfinite(twist.angular_rad_s)
