"""Drives a robot over a distance or a turn by its own odometry, slowly, and stops at whatever looks wrong."""

import math
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lira.hal.errors import LiraError
from lira.hal.messages import STOP, Applied, Command, LaserScan, Observation, Odometry, Reason, Twist
from lira.hal.port import Robot
from lira.robot.calibration import free_ahead_m, free_around_m
from lira.robot.core2.wheels import travelled

PERIOD_S = 0.05
ARM_S = 5.0
STALL_S = 2.0
STALL_SHARE = 0.02
PATIENCE = 3.0  # times as long as it should take
SETTLE_S = 1.0
LOW_BATTERY_V = 10.8
ROOM = 1.3  # a base that is not calibrated may go so many times as far as it reports
KEEP_M = 0.35  # from the lidar to whatever is ahead
BESIDE_M = 0.05
AROUND_M = 0.10  # beside the corners of the body when it turns
CREEP_SHARE = 0.9
CREEP = 0.4
SCANS = 8

WHY = {
    Reason.OBSTACLE: "something is in the way",
    Reason.ESTOP: "the emergency stop is pressed",
    Reason.STALE: "a device is lost",
}


class CalibrationError(LiraError):
    """The robot cannot be calibrated now, or what was measured cannot be right."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Speeds, both positive."""

    linear_m_s: float = 0.15
    angular_rad_s: float = 0.8


class Manoeuvre:
    """Moves `robot`, which is open. Every call returns with the wheels at zero, or raises `CalibrationError`."""

    def __init__(self, robot: Robot, pace: Pace) -> None:
        base = robot.profile.base
        self._robot = robot
        self._linear_m_s = min(pace.linear_m_s, base.max_linear_m_s)
        self._angular_rad_s = min(pace.angular_rad_s, base.max_angular_rad_s)

    def check(self, *, ahead_m: float = 0.0, turns: bool = False, lidar: bool) -> None:
        """Refuse to begin where it is not safe to go `ahead_m` (reported), or to turn on the spot."""
        seen = self._look(lambda seen: seen.battery is not None and (seen.scan is not None or not lidar))
        if seen.battery is not None and seen.battery.voltage_v < LOW_BATTERY_V:
            what = f"the battery is at {seen.battery.voltage_v:.1f} V"
            raise CalibrationError(what, f"Charge it: below {LOW_BATTERY_V} V wheels turn unevenly.")
        if not lidar:
            return
        if seen.scan is None:
            raise CalibrationError("the lidar shows nothing", "Wait until it turns, or calibrate --by tape.")
        base = self._robot.profile.base
        if ahead_m:
            free_m, needed_m = free_ahead_m(seen.scan, base, BESIDE_M), ROOM * ahead_m + KEEP_M
            if free_m < needed_m:
                what = f"only {free_m:.2f} m ahead are free, of {needed_m:.2f} m that this may need"
                raise CalibrationError(what, "Clear the way, or give a shorter --distance.")
        needed_m = math.hypot(base.length_m, base.width_m) / 2 + AROUND_M
        if turns and (free_m := free_around_m(seen.scan)) < needed_m:
            what = f"something is {free_m:.2f} m from the lidar, and {needed_m:.2f} m have to be free to turn"
            raise CalibrationError(what, "Make room around the robot.")

    def scan(self) -> LaserScan:
        """Several scans of the robot at rest, as one: the median of each beam."""
        scans: list[LaserScan] = []
        until_s = time.monotonic() + SETTLE_S + SCANS / 5.0
        while len(scans) < SCANS and time.monotonic() < until_s:
            scan = self._step(STOP)[0].scan
            if scan is not None and (not scans or scan is not scans[-1]):
                scans.append(scan)
        if len(scans) < 3:
            raise CalibrationError("the lidar shows nothing", "Look at its cable, or calibrate --by tape.")
        newest = scans[-1]
        beams = np.stack([scan.ranges for scan in scans if len(scan.ranges) == len(newest.ranges)])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a beam that never sees anything stays nan
            ranges = np.nanmedian(beams, axis=0)
        return LaserScan(
            newest.stamp_s,
            newest.angle_min,
            newest.angle_increment,
            newest.range_min,
            newest.range_max,
            ranges.astype(np.float32),
        )

    def ahead(self, distance_m: float) -> "Way":
        """Drive straight on until the odometry says so many metres; returns what it says at rest."""
        return self._go(Twist(self._linear_m_s, 0.0), distance_m)

    def turn(self, angle_rad: float) -> "Way":
        """Turn left on the spot until the odometry says so many radians; returns what it says at rest."""
        return self._go(Twist(0.0, self._angular_rad_s), angle_rad)

    def _go(self, twist: Twist, target: float) -> "Way":
        self._arm()
        way = Way(turns=twist.angular_rad_s != 0.0)
        speed = max(twist.linear_m_s, twist.angular_rad_s)
        began_s = time.monotonic()
        try:
            while way.done < target:
                elapsed_s = time.monotonic() - began_s
                if elapsed_s > STALL_S and way.done < STALL_SHARE * target:
                    raise CalibrationError("the wheels do not turn", "Is the robot free, and its battery charged?")
                if elapsed_s > PATIENCE * target / speed + STALL_S:
                    raise CalibrationError("it takes far too long", "Is the robot free to move, and the floor even?")
                share = CREEP if way.done > CREEP_SHARE * target else 1.0
                seen, applied = self._step(Twist(share * twist.linear_m_s, share * twist.angular_rad_s))
                self._watch(seen, applied, way)
        finally:
            self._robot.drive(Command(STOP, self._robot.now()))
        until_s = time.monotonic() + SETTLE_S
        while time.monotonic() < until_s:
            way.see(self._step(STOP)[0])
        return way

    def _watch(self, seen: Observation, applied: Applied, way: "Way") -> None:
        if "field_blind" in applied.clamps:
            what = "the robot stopped: its protective field does not see the way"
            raise CalibrationError(what, "Look at its cable and its window.")
        if applied.reason is not Reason.OK:
            why = WHY.get(applied.reason, "it does not move")
            clamps = f" ({', '.join(applied.clamps)})" if applied.clamps else ""
            raise CalibrationError(f"the robot stopped: {why}{clamps}", "See to that, and begin again.")
        if seen.odom is None:
            raise CalibrationError("the base no longer tells where it is", "Look at its cable, and begin again.")
        way.see(seen)

    def _arm(self) -> None:
        until_s = time.monotonic() + ARM_S
        while (applied := self._step(STOP)[1]).reason is not Reason.OK:
            if time.monotonic() > until_s:
                lost = ", ".join(applied.clamps) or applied.reason.value
                raise CalibrationError(f"the robot cannot move now: {lost}", "See to that, and begin again.")

    def _look(self, enough: Callable[[Observation], bool]) -> Observation:
        """Wait a while until enough is seen; returns what is seen in the end."""
        until_s = time.monotonic() + ARM_S
        while not enough(seen := self._step(STOP)[0]) and time.monotonic() < until_s:
            pass
        return seen

    def _step(self, twist: Twist) -> tuple[Observation, Applied]:
        seen = self._robot.read()
        applied = self._robot.drive(Command(twist, self._robot.now(), answers=seen.seq))
        self._robot.wait(self._robot.now() + PERIOD_S)
        return seen, applied


class Way:
    """What the odometry says of a way: metres ahead and radians to the left; `done` is that of the two which counts."""

    def __init__(self, *, turns: bool) -> None:
        self._turns = turns
        self._before: Odometry | None = None
        self.ahead_m = self.turn_rad = 0.0

    @property
    def done(self) -> float:
        """Radians of a turn, metres of a drive."""
        return self.turn_rad if self._turns else self.ahead_m

    def see(self, seen: Observation) -> None:
        """Go on from where it was seen last."""
        before, odom = self._before, seen.odom
        if odom is None:
            return
        if before is not None:
            ahead_m, turn_rad = travelled(before, odom)
            self.ahead_m += ahead_m
            self.turn_rad += turn_rad
        self._before = odom
