"""A robot behind its governor: whatever is asked of it, only what the governor allows reaches the wheels."""

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import msgspec

from lira.hal.clock import is_fresh
from lira.hal.messages import Applied, Command, DiagnosticStatus, LaserScan, Observation, Reason
from lira.hal.port import DeviceHealth, DeviceMonitor, MotorSwitch, Robot, SelfDiagnosis, SensorEvents
from lira.hal.profile import Field, RobotProfile
from lira.hal.safety.arming import State
from lira.hal.safety.governor import Governor
from lira.hal.safety.protective_field import Clearance, measure_clearance

SLICE_S = 0.05  # the watchdog looks at least this often while the robot's time passes in `wait`
ROUNDING_S = 1e-9
FIELD_OFF = "the protective field is off: there is no lidar, so nothing stops the robot before an obstacle"


class GovernedRobot:
    """Implements `hal.port.Robot` around a raw one.

    A robot that is to be driven without a lidar has no protective field: `profile` is then without it, and
    `field_off` says so.

    All but `open`, `read`, `wait` and `close` may be called from any thread; the lock they share is never held while a
    sensor is read or time passes, so a watchdog thread that calls `tick` waits for nothing but the base.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._monitor = robot if isinstance(robot, DeviceMonitor) else None
        self._profile, self.field_off = _without_field(robot.profile, self._health().absent)
        self._governor = Governor(self._profile)
        self._switch = robot if isinstance(robot, MotorSwitch) else None
        self._cut = False  # the motors' power, by the emergency stop
        self._scan: LaserScan | None = None  # that the field saw last
        self._lock = threading.Lock()

    @property
    def profile(self) -> RobotProfile:
        """The robot's profile, as it is driven by."""
        return self._profile

    @property
    def state(self) -> State:
        """Whether motion is allowed now."""
        return self._governor.state

    @property
    def refused(self) -> dict[str, int]:
        """How many commands were refused, by reason."""
        return dict(self._governor.refused)

    @property
    def losses(self) -> int:
        """How often a device was lost."""
        return self._health().losses

    @property
    def diagnostics(self) -> tuple[DiagnosticStatus, ...]:
        """What its devices say of themselves, where they do."""
        return self._robot.diagnostics() if isinstance(self._robot, SelfDiagnosis) else ()

    def open(self) -> None:
        """Bring the devices up."""
        self._robot.open()

    def read(self) -> Observation:
        """Return the newest of every sensor; the protective field, if there is one, sees the scan."""
        observation = self._robot.read()
        scan, field = observation.scan, self._profile.field
        if field is not None and scan is not None and scan is not self._scan:
            clearance = self._measure(field, scan)
            with self._lock:
                self._scan, self._governor.clearance = scan, clearance
        return observation

    def now(self) -> float:
        """Seconds on the robot's clock."""
        return self._robot.now()

    def drive(self, command: Command) -> Applied:
        """Submit a command and let it act at once."""
        with self._lock:
            self._governor.submit(command, self._robot.now())
            return self._actuate()

    def submit(self, command: Command) -> None:
        """Hand in a command that acts at the next `tick` or `drive`."""
        with self._lock:
            self._governor.submit(command, self._robot.now())

    def tick(self) -> Applied:
        """Let time-outs strike and pass what remains to the base. Call it at 50 Hz where time passes by itself."""
        with self._lock:
            return self._actuate()

    def wait(self, until_s: float) -> None:
        """Let the robot's time pass, with the watchdog awake."""
        # It looks before each slice and not after the last: what the caller does next may be the command it misses.
        while (now_s := self._robot.now()) < until_s - ROUNDING_S:
            self.tick()
            slice_s = self._slice_s(now_s)
            self._robot.wait(until_s if until_s - now_s < slice_s + ROUNDING_S else now_s + slice_s)

    def pass_time(self, until_s: float) -> None:
        """As `wait`, for a server that has its watchdog on another thread; not as long if there is something new."""
        if isinstance(self._robot, SensorEvents):
            self._robot.wait_news(until_s)
        else:
            self._robot.wait(until_s)

    def halt(self) -> Applied:
        """Stop now, forget every command."""
        with self._lock:
            self._governor.halt()
            return self._actuate()

    def press_estop(self) -> Applied:
        """Stop now, until the emergency stop is released."""
        with self._lock:
            self._governor.press()
            return self._actuate()

    def release_estop(self) -> Applied:
        """Let go of the emergency stop; the robot moves again after a neutral command."""
        with self._lock:
            self._governor.release(self._robot.now())
            return self._actuate()

    def close(self) -> None:
        """Stop the wheels, then let go of the devices."""
        try:
            self.halt()
        finally:
            self._robot.close()

    def _measure(self, field: Field, scan: LaserScan) -> Clearance | None:
        """How free the way is; None for a scan that is not of now. One that is a little ahead counts from now."""
        now_s = self._robot.now()
        if not is_fresh(scan.stamp_s, now_s, field.max_age_s):
            return None
        return measure_clearance(self._profile, field, replace(scan, stamp_s=min(scan.stamp_s, now_s)))

    def _slice_s(self, now_s: float) -> float:  # noqa: ARG002 - for those who know more
        """How long the watchdog may look away from now on."""
        return SLICE_S

    def _health(self) -> DeviceHealth:
        return DeviceHealth() if self._monitor is None else self._monitor.device_health()

    def _actuate(self) -> Applied:
        health = self._health()
        self._governor.note_devices(health.lost, health.losses)
        allowed = self._governor.tick(self._robot.now())
        # The base times it out by itself, from when it was decided, should nobody come back here.
        decided_s = allowed.stamp_s if math.isnan(allowed.command_age_s) else allowed.stamp_s - allowed.command_age_s
        got = self._robot.drive(Command(allowed.twist, decided_s, allowed.source, allowed.answers))
        if self._robot.now() - allowed.stamp_s > self._profile.control.robot_timeout_s:
            # The base hung on it: what it took in the end is old by now.
            self._governor.halt()
            allowed = self._governor.tick(self._robot.now())
            got = self._robot.drive(Command(allowed.twist, allowed.stamp_s))
        self._switch_motors()
        # What is allowed may still not happen: a base that refuses it says why it stands.
        reason = got.reason if allowed.reason is Reason.OK else allowed.reason
        if reason is allowed.reason and got.twist == allowed.twist and not got.clamps:
            return allowed
        return replace(allowed, twist=got.twist, reason=reason, clamps=allowed.clamps + got.clamps)

    def _switch_motors(self) -> None:
        """Cut the motors' power while the emergency stop holds, where there is a switch; zero was commanded before."""
        emergency = self._governor.state is State.EMERGENCY
        if self._switch is not None and emergency is not self._cut:
            self._switch.cut_motors(emergency)
            self._cut = emergency


def _without_field(profile: RobotProfile, absent: tuple[str, ...]) -> tuple[RobotProfile, str]:
    """Return the profile to drive by, and why its protective field is off, "" unless it is."""
    if profile.field is None or "lidar" not in absent:
        return profile, ""
    return msgspec.structs.replace(profile, field=None), FIELD_OFF


@contextmanager
def govern(robot: Robot) -> Iterator[GovernedRobot]:
    """Open a raw robot behind a governor of its own, and close it in the end: what drives it here cannot go too far."""
    governed = GovernedRobot(robot)
    try:
        governed.open()
        yield governed
    finally:
        governed.close()
