"""The lidar: a fan of rays against the scene's boxes, and its noise."""

import math

import numpy as np

from lira.hal.messages import FloatArray, LaserScan
from lira.hal.profile import Lidar
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.base import Pose, Scene


def beam_angles(lidar: Lidar) -> Floats:
    """Angles [beams] from base_link's x, counter-clockwise. A full turn begins behind."""
    return np.arange(lidar.beams, dtype=np.float64) * lidar.increment_rad - lidar.fov_rad / 2


class RayLidar:
    """Scans a scene from the robot's pose."""

    def __init__(self, lidar: Lidar, scene: Scene, rng: np.random.Generator) -> None:
        self._lidar = lidar
        self._scene = scene
        self._rng = rng
        self._angles = beam_angles(lidar)

    def scan(self, pose: Pose, stamp_s: float) -> LaserScan:
        """One turn, captured at an instant. Ranges after REP-117: +inf no return, -inf too close, nan dropped out."""
        lidar = self._lidar
        ranges = self._scene.ranges_m(*self.fan(pose))
        return LaserScan(
            stamp_s=stamp_s,
            angle_min=float(self._angles[0]),
            angle_increment=lidar.increment_rad,
            range_min=lidar.range_min_m,
            range_max=lidar.range_max_m,
            ranges=self._spoil(ranges),
            scan_time=1.0 / lidar.rate_hz,
        )

    def fan(self, pose: Pose) -> tuple[tuple[float, float, float], Floats, float]:
        """Return the rays from a robot at this pose: where they begin, their angles [beams], how far they reach."""
        lidar, (x_m, y_m, yaw_rad) = self._lidar, pose
        origin = (x_m + lidar.x_m * math.cos(yaw_rad), y_m + lidar.x_m * math.sin(yaw_rad), lidar.z_m)
        return origin, self._angles + yaw_rad, lidar.range_max_m

    def _spoil(self, ranges: Floats) -> FloatArray:
        """Add the noise of a real device, then say what it cannot measure."""
        lidar = self._lidar
        if lidar.noise_m:
            ranges = ranges + self._rng.normal(0.0, lidar.noise_m, len(ranges))
        ranges = np.where(ranges > lidar.range_max_m, math.inf, ranges)
        ranges = np.where(ranges < lidar.range_min_m, -math.inf, ranges)
        if lidar.dropout:
            ranges = np.where(self._rng.random(len(ranges)) < lidar.dropout, math.nan, ranges)
        return ranges.astype(np.float32)
