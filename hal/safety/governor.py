"""The governor: what the wheels get, from whom, and why. Pure: no threads, no clock, no bus.

`arming.py` has the state machine; here is who is in charge, what counts as which event, and the limits.

Teleop is in charge while its hand is on, else policy. A hand goes off by saying so (`released`); if it goes silent
instead, the robot stops and policy does not take over. A hand that lets go holds the robot at zero until policy
commands, and no longer than its time-out, whatever it says after that. A zero of a hand that has let go does nothing.

Outside `ARMED` no command that is still alive carries motion: what was commanded before a stop does not drive after it.
"""

import math
from collections import Counter
from dataclasses import replace

from lira.hal.clock import AHEAD_S
from lira.hal.messages import STOP, Applied, Command, Reason, Source, Twist, is_neutral, session_of
from lira.hal.messages.motion import Token
from lira.hal.profile import RobotProfile
from lira.hal.safety.arming import TRANSITIONS, Event, State
from lira.hal.safety.lease import Lease
from lira.hal.safety.protective_field import Clearance, limit_speed

ROUNDING_S = 1e-6  # stamps travel in whole nanoseconds; sums of periods are less exact than that
# The watchdog strikes at the time-out. A command that comes late by less than its own period is obeyed if the watchdog
# has not struck: without this a stream at exactly the time-out would hang on rounding.
GRACE_S = 0.02
RAMP_S = 0.05  # the speed limit never rises by more than this much time's worth at once, however long nobody looked


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
        self._newest: dict[Source, Command] = {}  # as it was stamped: what came before it from there is out of order
        self._not_before_s = -math.inf  # what was sent before the emergency stop was released does not count
        self._cut_off: Token | None = None  # the hand that moved at the stop or since, until it is at zero itself
        self._lost: tuple[str, ...] = ()
        self._losses = 0
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
            # A broken policy does not take control out of a person's hand.
            if command.source is Source.TELEOP or not self._hand_on():
                self._fire(Event.BROKEN)
            self._live.pop(command.source, None)
        else:
            self._accept(command, now_s)

    def tick(self, now_s: float) -> Applied:
        """Let time-outs strike and return what the wheels get now."""
        self._expire(now_s, -ROUNDING_S)
        command = self._in_charge()
        twist, source, reason, cut_m_s = STOP, Source.NONE, self._reason, 0.0
        clamps = tuple(f"no_{name}" for name in self._lost)
        if self._state is State.ARMED and command is not None:
            source = command.source
            twist, clamps, cut_m_s = self._limit(command.twist, now_s)
            if "field_stop" in clamps or "field_blind" in clamps:
                reason = Reason.OBSTACLE
        self._last, self._last_s = twist, now_s
        if command is None:
            return Applied(twist, now_s, source, reason, clamps)
        age_s = now_s - command.stamp_s
        session = session_of(command.epoch)
        asked = command.answers, age_s, session, command.seq, command.commander
        return Applied(twist, now_s, source, reason, clamps, *asked, cut_m_s)

    def steady_until(self, now_s: float) -> float:
        """Until when `tick` says what it said last, as long as nothing is submitted and no device is lost.

        That is `now_s` where it depends on more than time-outs: on a field, or on a speed that is still rising.
        """
        command = self._in_charge() if self._state is State.ARMED else None
        if command is not None and (self._field is not None or self._last != self._within_limits(command.twist)):
            return now_s
        return min((each.stamp_s + self._timeouts_s[each.source] for each in self._live.values()), default=math.inf)

    def note_devices(self, lost: tuple[str, ...], losses: int) -> None:
        """Take in which devices are lost now, and how many losses there ever were: one between two looks counts too."""
        missed = losses > self._losses
        if lost or missed:
            self._fire(Event.LOST)
        if not lost and (missed or self._lost):
            self._fire(Event.FOUND)
        self._lost, self._losses = lost, losses

    def halt(self) -> None:
        """Stop and forget every command."""
        self._fire(Event.HALTED)
        self._live.clear()

    def press(self) -> None:
        """Stop until `release`."""
        self._fire(Event.PRESSED)

    def release(self, now_s: float) -> None:
        """Let go of the emergency stop. What was commanded before does not count any more."""
        self._not_before_s = now_s
        self._fire(Event.RELEASED)

    def _fire(self, event: Event) -> None:
        self._state, self._reason = TRANSITIONS[self._state, event]
        if self._state is State.ARMED:
            return
        hand = self._live.get(Source.TELEOP)
        if hand is not None and not is_neutral(hand.twist):
            self._cut_off = hand.token
        self._live = {source: replace(command, twist=STOP) for source, command in self._live.items()}

    def _objection(self, command: Command, now_s: float) -> str | None:
        timeout_s = self._timeouts_s.get(command.source)
        if timeout_s is None:
            return "no source"
        if not math.isfinite(command.stamp_s):
            return "no time"
        if command.stamp_s > now_s + AHEAD_S:
            return "from the future"
        newest = self._newest.get(command.source)
        # One commander's clock, which may run ahead, does not put another's commands out of order.
        in_order = newest is None or newest.token != command.token or command.stamp_s >= newest.stamp_s
        if not in_order or command.stamp_s < self._not_before_s:
            return "out of order"
        if now_s - command.stamp_s >= timeout_s - ROUNDING_S:
            return "late"
        return self._leases[command.source].objection(command.token, now_s)

    def _accept(self, command: Command, now_s: float) -> None:
        twist = STOP if command.released else command.twist
        taken = replace(command, twist=twist, stamp_s=min(command.stamp_s, now_s))
        if command.source is Source.TELEOP and is_neutral(twist) and command.token == self._cut_off:
            self._cut_off = None
        if command.released:
            self._let_go(command, taken)
            return
        self._newest[command.source] = command
        self._leases[command.source].renew(command.token, now_s)
        self._live[command.source] = taken
        if self._in_charge() is taken:
            self._fire(self._event_of(taken))

    def _event_of(self, command: Command) -> Event:
        """What it means that who is in charge commands this."""
        if is_neutral(command.twist):
            return Event.NEUTRAL
        cut_off = command.source is Source.TELEOP and command.token == self._cut_off
        return Event.RESUMED if cut_off else Event.MOTION

    def _let_go(self, command: Command, taken: Command) -> None:
        """Policy or a hand leaves control to others. A hand that had left it before says nothing new."""
        self._leases[command.source].release()
        if command.source is Source.POLICY:
            self._newest[Source.POLICY] = command
            self._live.pop(Source.POLICY, None)
            if not self._hand_on():
                self._fire(Event.HALTED)
        elif self._hand_on():
            self._newest[Source.TELEOP] = command
            self._live[Source.TELEOP] = taken

    def _expire(self, now_s: float, grace_s: float) -> None:
        """Drop what is older than its time-out. It stops the robot if that was in charge."""
        old = [
            command
            for command in self._live.values()
            if now_s - command.stamp_s >= self._timeouts_s[command.source] + grace_s
        ]
        if old and self._in_charge() in old:
            self._fire(Event.EXPIRED)
        for command in old:
            del self._live[command.source]

    def _in_charge(self) -> Command | None:
        teleop, policy = self._live.get(Source.TELEOP), self._live.get(Source.POLICY)
        return teleop if self._hand_on() or policy is None else policy

    def _hand_on(self) -> bool:
        teleop = self._live.get(Source.TELEOP)
        return teleop is not None and not teleop.released

    def _within_limits(self, wanted: Twist) -> Twist:
        linear, angular = self._limits
        return Twist(
            min(max(wanted.linear_m_s, -linear), linear),
            min(max(wanted.angular_rad_s, -angular), angular),
        )

    def _limit(self, wanted: Twist, now_s: float) -> tuple[Twist, tuple[str, ...], float]:
        """Cut to the profile's limits, then to what the field allows, then to what can be reached by now.

        Returns what is left, the names of what cut it, and the speed in m/s that the field took.
        """
        within = self._within_limits(wanted)
        linear, angular = within.linear_m_s, within.angular_rad_s
        clamps = ["linear"] if linear != wanted.linear_m_s else []
        clamps += ["angular"] if angular != wanted.angular_rad_s else []
        asked = linear
        if self._field is not None:
            linear, cut = limit_speed(self._field, self.clearance, asked, now_s)
            clamps += [cut] if cut else []
        passed_s = min(now_s - self._last_s, RAMP_S)
        ramped_linear = _ramp(linear, self._last.linear_m_s, self._ramps[0], passed_s)
        ramped_angular = _ramp(angular, self._last.angular_rad_s, self._ramps[1], passed_s)
        clamps += ["acceleration"] if (ramped_linear, ramped_angular) != (linear, angular) else []
        return Twist(ramped_linear, ramped_angular), tuple(clamps), asked - linear


def _ramp(wanted: float, before: float, limit: float | None, passed_s: float) -> float:
    """Speed up no faster than the limit; slowing down is never held up."""
    if limit is None:
        return wanted
    start = abs(before) if wanted * before > 0.0 else 0.0
    return math.copysign(min(abs(wanted), start + limit * passed_s), wanted)


def _is_finite(twist: Twist) -> bool:
    return math.isfinite(twist.linear_m_s) and math.isfinite(twist.angular_rad_s)
