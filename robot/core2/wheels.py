"""Odometry of the CORE2: from its pose and velocity in the odom frame to body velocity and a corrected pose."""

import math
from dataclasses import dataclass

from lira.hal.messages import Odometry
from lira.robot.settings import BaseSettings

# Nobody drives so far between two poses: the board began to count anew.
JUMP_M = 0.3


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose in the plane."""

    x_m: float
    y_m: float
    yaw_rad: float


class Reckoner:
    """Turns the board's poses into odometry with the robot's own calibration. The first pose is the origin."""

    def __init__(self, settings: BaseSettings) -> None:
        self._settings = settings
        self._reported: Pose | None = None
        self._pose = Pose(0.0, 0.0, 0.0)

    def rebase(self) -> None:
        """The board counts anew: its next pose is where the robot is."""
        self._reported = None

    def step(
        self, reported: Pose, velocity: tuple[float, float, float], stamp_s: float, *, in_body: bool = False
    ) -> Odometry:
        """Take a pose, and the velocity (x, y, m/s, and yaw, rad/s) that belongs to it.

        The velocity is in the odom frame, with mecanum firmware in the body's (`in_body`).
        """
        before, self._reported = self._reported, reported
        if before is not None:
            self._advance(before, reported)
        x_m_s, y_m_s, turn_rad_s = velocity
        yaw_rad = 0.0 if in_body else reported.yaw_rad
        ahead_m_s = x_m_s * math.cos(yaw_rad) + y_m_s * math.sin(yaw_rad)
        settings, pose = self._settings, self._pose
        return Odometry(
            stamp_s,
            pose.x_m,
            pose.y_m,
            math.remainder(pose.yaw_rad, math.tau),
            settings.distance_scale * (ahead_m_s - settings.spin_slip_m_rad * turn_rad_s),
            settings.turn_scale * turn_rad_s,
        )

    def _advance(self, before: Pose, after: Pose) -> None:
        settings = self._settings
        if math.hypot(after.x_m - before.x_m, after.y_m - before.y_m) > JUMP_M:
            return
        ahead_m, turn_rad = travelled(before, after)
        ahead_m = settings.distance_scale * (ahead_m - settings.spin_slip_m_rad * turn_rad)
        turn_rad *= settings.turn_scale
        pose = self._pose
        heading_rad = pose.yaw_rad + turn_rad / 2
        self._pose = Pose(
            pose.x_m + ahead_m * math.cos(heading_rad),
            pose.y_m + ahead_m * math.sin(heading_rad),
            pose.yaw_rad + turn_rad,
        )


def travelled(before: Pose | Odometry, after: Pose | Odometry) -> tuple[float, float]:
    """How far ahead a robot went between two poses, metres, and how far it turned to the left, radians."""
    turn_rad = math.remainder(after.yaw_rad - before.yaw_rad, math.tau)
    heading_rad = before.yaw_rad + turn_rad / 2
    east_m, north_m = after.x_m - before.x_m, after.y_m - before.y_m
    return east_m * math.cos(heading_rad) + north_m * math.sin(heading_rad), turn_rad
