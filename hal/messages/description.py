"""How a robot is built, as ROS 2 tells it: transforms between frames, what its camera projects, its model as text."""

from dataclasses import dataclass

# Frames, by REP-103 and REP-105. `base_link` lies on the floor, below the middle between the wheels.
ODOM_FRAME = "odom"
BASE = "base_link"
FOOTPRINT = "base_footprint"  # the same place, for those that look for it by this name
LASER = "laser"
CAMERA_LINK = "camera_link"  # x into the picture
OPTICAL = "camera_optical_frame"  # z into the picture, x to its right
IMU_LINK = "imu_link"

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Transform:
    """Where frame `child` stands in frame `parent`: `translation` in metres, `rotation` as a quaternion x, y, z, w."""

    parent: str
    child: str
    translation: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Transforms:
    """tf2_msgs/TFMessage: where frames stand at `stamp_s`. For frames that never move the stamp means nothing."""

    stamp_s: float
    transforms: tuple[Transform, ...]


@dataclass(frozen=True, slots=True)
class Text:
    """std_msgs/String."""

    data: str


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """sensor_msgs/CameraInfo: what a camera of `width` x `height` pixels projects to where, in pixels.

    `k` [9], `r` [9] and `p` [12] are the camera, rectification and projection matrix, row by row; `d` are the
    distortion's coefficients, none for a pinhole.
    """

    stamp_s: float
    width: int
    height: int
    k: tuple[float, ...]
    p: tuple[float, ...]
    d: tuple[float, ...] = ()
    r: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    distortion_model: str = "plumb_bob"
