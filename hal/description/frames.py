"""Where a robot's frames are, from its profile: one tree, rooted in `odom` (REP-103, REP-105). Pure."""

import math
from dataclasses import dataclass

from lira.hal.messages import Odometry, Transform, Transforms
from lira.hal.messages.description import (
    BASE,
    CAMERA_LINK,
    FOOTPRINT,
    IMU_LINK,
    LASER,
    ODOM_FRAME,
    OPTICAL,
    Quaternion,
    Vector,
)
from lira.hal.profile import RobotProfile


@dataclass(frozen=True, slots=True)
class Mount:
    """Where a frame is fixed to another: metres, and turned by roll, pitch and yaw about the parent's axes, radians."""

    parent: str
    child: str
    xyz_m: Vector = (0.0, 0.0, 0.0)
    rpy_rad: Vector = (0.0, 0.0, 0.0)

    @property
    def transform(self) -> Transform:
        """The same as a transform."""
        return Transform(self.parent, self.child, self.xyz_m, quaternion_of(*self.rpy_rad))


# z into the picture, x to its right, y down.
_OPTICAL_RPY = (-math.pi / 2, 0.0, -math.pi / 2)


def mounts_of(profile: RobotProfile) -> tuple[Mount, ...]:
    """Every frame of the body, and where it is fixed, parents first.

    `base_link` lies on the floor, so that odometry has no height; `base_footprint` is the same place. Scans come in the
    robot's own orientation, however the unit is mounted, so `laser` is not turned.
    """
    lidar, camera = profile.lidar, profile.camera
    mounts = [
        Mount(BASE, FOOTPRINT),
        Mount(BASE, LASER, (lidar.x_m, 0.0, lidar.z_m)),
        Mount(BASE, CAMERA_LINK, (camera.x_m, 0.0, camera.z_m), (0.0, camera.pitch_rad, 0.0)),
        Mount(CAMERA_LINK, OPTICAL, rpy_rad=_OPTICAL_RPY),
    ]
    if profile.imu is not None:
        mounts.append(Mount(BASE, IMU_LINK, (0.0, 0.0, profile.base.height_m / 2)))
    mounts += [
        Mount(BASE, each.frame_id, (each.x_m, each.y_m, each.z_m), (0.0, 0.0, each.yaw_rad)) for each in profile.ranger
    ]
    return tuple(mounts)


def static_transforms(profile: RobotProfile, stamp_s: float) -> Transforms:
    """What goes on `tf_static`: every frame of the body."""
    return Transforms(stamp_s, tuple(mount.transform for mount in mounts_of(profile)))


def odometry_transform(odom: Odometry) -> Transforms:
    """What goes on `tf`: where the body is by its odometry."""
    at = Transform(ODOM_FRAME, BASE, (odom.x_m, odom.y_m, 0.0), quaternion_of(0.0, 0.0, odom.yaw_rad))
    return Transforms(odom.stamp_s, (at,))


def quaternion_of(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Return the rotation by roll, then pitch, then yaw about fixed axes, as URDF has it."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll_rad, pitch_rad, yaw_rad))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
