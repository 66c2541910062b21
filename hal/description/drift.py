"""How far a robot's odometry may be off by now: it grows with the way and the turns, and never shrinks. Pure."""

import math
from dataclasses import replace

from lira.hal.messages import Odometry, Spread
from lira.hal.profile import Base

WAY_ERROR = 0.02  # of the way driven: what calibration by tape or lidar leaves
TURN_ERROR = 0.01  # of the angle turned, at least
FLOOR_M, FLOOR_RAD = 0.002, 0.002
# The firmware's regulator swings around its setpoint by half of its step of 15 mm/s.
SPEED_FLOOR_M_S, TURN_FLOOR_RAD_S = 0.0075, 0.035
JUMP_M = 0.5  # between two readings: it was put down elsewhere and counts anew


class Drift:
    """Adds up what may be wrong, from one reading to the next.

    Wheels that skid turn the body by another track than the odometry reckons with: the share that its profile tells of
    is the error of a turn.
    """

    def __init__(self, base: Base) -> None:
        truly_m = base.effective_track_m or base.track_m
        self._turn_error = max(TURN_ERROR, abs(truly_m / (base.odometry_track_m or base.track_m) - 1.0))
        self._last: Odometry | None = None
        self._way_m = self._turn_rad = self._aside_m = 0.0

    def note(self, odom: Odometry) -> Odometry:
        """Return the reading with how far it may be off; readings come in their order."""
        last, self._last = self._last, odom
        way_m = 0.0 if last is None else math.hypot(odom.x_m - last.x_m, odom.y_m - last.y_m)
        if last is None or way_m > JUMP_M:
            self._way_m = self._turn_rad = self._aside_m = 0.0
        else:
            self._way_m += way_m
            self._turn_rad += abs(math.remainder(odom.yaw_rad - last.yaw_rad, math.tau))
            self._aside_m += way_m * math.sin(min(self._yaw_error_rad, math.pi / 2))
        return replace(odom, spread=self._spread(odom))

    @property
    def _yaw_error_rad(self) -> float:
        return min(FLOOR_RAD + self._turn_error * self._turn_rad, math.pi)

    def _spread(self, odom: Odometry) -> Spread:
        """A wrong heading carries the way to the side."""
        return Spread(
            FLOOR_M + math.hypot(WAY_ERROR * self._way_m, self._aside_m),
            self._yaw_error_rad,
            SPEED_FLOOR_M_S + WAY_ERROR * abs(odom.linear_m_s),
            TURN_FLOOR_RAD_S + self._turn_error * abs(odom.angular_rad_s),
        )
