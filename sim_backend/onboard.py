"""What a robot measures beside its lidar and camera: acceleration and turn, short ranges, its battery. Pure."""

import math
from collections.abc import Callable

import numpy as np

from lira.hal.messages import BatteryState, Imu, Range
from lira.hal.profile import Battery, Ranger
from lira.hal.profile import Imu as ImuProfile
from lira.sim_backend.drive import Motion
from lira.sim_backend.polyline import Floats

CONE_RAYS = 5  # of a ranger

Look = Callable[[tuple[float, float, float], Floats, float], Floats]
"""From a point along level rays of some angles [n], so far: where each meets something, +inf where nothing."""


class Accelerometer:
    """The IMU: accelerations are what changed since the last reading."""

    def __init__(self, imu: ImuProfile, rng: np.random.Generator) -> None:
        self.rate_hz = imu.rate_hz
        self._imu = imu
        self._rng = rng
        self._before: tuple[float, float] | None = None  # stamp, speed

    def read(self, motion: Motion, now_s: float) -> Imu:
        """Measure the motion at `now_s`."""
        speed_m_s, turn_rad_s = float(motion.linear_m_s), float(motion.angular_rad_s)
        then_s, then_m_s = self._before or (now_s, speed_m_s)
        self._before = now_s, speed_m_s
        ahead_m_s2 = (speed_m_s - then_m_s) / (now_s - then_s) if now_s > then_s else 0.0
        imu, noise = self._imu, self._rng.standard_normal(3)
        return Imu(
            now_s,
            math.remainder(float(motion.yaw_rad), math.tau),
            turn_rad_s + imu.noise_rad_s * noise[0],
            ahead_m_s2 + imu.noise_m_s2 * noise[1],
            speed_m_s * turn_rad_s + imu.noise_m_s2 * noise[2],
        )


def read_ranger(ranger: Ranger, look: Look, motion: Motion, now_s: float) -> Range:
    """Measure with a ranger from the robot's pose: the nearest of a few rays. REP-117."""
    yaw_rad = float(motion.yaw_rad)
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    x_m = float(motion.x_m) + cos * ranger.x_m - sin * ranger.y_m
    y_m = float(motion.y_m) + sin * ranger.x_m + cos * ranger.y_m
    angles = yaw_rad + ranger.yaw_rad + ranger.fov_rad * np.linspace(-0.5, 0.5, CONE_RAYS)
    range_m = float(look((x_m, y_m, ranger.z_m), angles, ranger.range_max_m).min())
    if range_m < ranger.range_min_m:
        range_m = -math.inf
    return Range(now_s, ranger.frame_id, range_m, ranger.range_min_m, ranger.range_max_m)


def read_battery(battery: Battery, now_s: float) -> BatteryState:
    """Voltage after so long a time since it was full."""
    left = max(1.0 - now_s / battery.lasts_s, 0.0)
    return BatteryState(now_s, battery.empty_v + left * (battery.full_v - battery.empty_v))
