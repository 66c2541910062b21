"""The values that cross modules. They mirror the ROS 2 messages of the same name and keep their field names.

Frames and units: REP-103 (SI units, x forward, y left, yaw counter-clockwise) and REP-105; ranges after REP-117
(+inf: no return, -inf: too close, nan: bad). Every `stamp_s` is a capture or decision time on the robot's clock.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]
WordArray = NDArray[np.uint16]


@dataclass(frozen=True, slots=True)
class Bool:
    """std_msgs/Bool."""

    data: bool


@dataclass(frozen=True, slots=True)
class Joy:
    """sensor_msgs/Joy. `axes` in [-1, 1] with up and left positive, `buttons` 0 or 1, in the order of the mapping."""

    stamp_s: float
    axes: tuple[float, ...]
    buttons: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class JoyFeedback:
    """sensor_msgs/JoyFeedback: what a pad should do. `intensity` in [0, 1]."""

    TYPE_RUMBLE: ClassVar[int] = 1

    type: int
    id: int
    intensity: float


@dataclass(frozen=True, slots=True)
class DiagnosticStatus:
    """diagnostic_msgs/DiagnosticStatus. `level`: 0 ok, 1 warning, 2 error, 3 stale; `values` are pairs of text."""

    level: int
    name: str
    message: str
    values: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class DiagnosticArray:
    """diagnostic_msgs/DiagnosticArray: what the parts of a process say about themselves."""

    stamp_s: float
    status: tuple[DiagnosticStatus, ...]


class Request(StrEnum):
    """What a person can ask of whoever drives and learns."""

    PAUSE = "pause"  # the robot stands and nothing is learned
    RESUME = "resume"
    RESET = "reset"  # a new episode; on a twin from the start
    SAVE = "save"  # all that was learned, to disk, now
    HANDOVER = "handover"  # to the expert that is named
    PROVE = "prove"  # the novice alone, to see whether it can; asked again: it passed, or the verdict ends the session
    PASSED = "passed"  # a person's judgement of what the novice just drove
    FAILED = "failed"
    UNDO = "undo"  # the labels of the last intervention are taken back
    FINISH = "finish"  # the session ends


@dataclass(frozen=True, slots=True)
class OperatorRequest:
    """A person's request (`operator`). `name` is the expert that shall drive, empty for the other requests."""

    request: Request
    name: str = ""


@dataclass(frozen=True, slots=True)
class OperatorAnswer:
    """What became of the newest request, and whether driving and learning are paused (`operator/answer`).

    `count` requests have been answered; before the first `words` is empty.
    """

    stamp_s: float
    paused: bool = False
    count: int = 0
    accepted: bool = True
    words: str = ""


@dataclass(frozen=True, slots=True)
class LaserScan:
    """sensor_msgs/LaserScan. `ranges`: float32 [n], counter-clockwise from `angle_min`, metres, REP-117."""

    stamp_s: float
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: FloatArray
    scan_time: float = 0.0
    time_increment: float = 0.0


@dataclass(frozen=True, slots=True)
class Image:
    """sensor_msgs/Image. `data`: uint8 [height, width, 3] for rgb8, [height, width] for mono8."""

    stamp_s: float
    data: ByteArray
    encoding: str = "rgb8"


@dataclass(frozen=True, slots=True)
class DepthImage:
    """sensor_msgs/Image of encoding 16UC1. `data`: uint16 [height, width], millimetres along the optical axis, 0: none.

    It travels as a PNG of 16 bits.
    """

    stamp_s: float
    data: WordArray


@dataclass(frozen=True, slots=True)
class CompressedImage:
    """sensor_msgs/CompressedImage. `format` is "jpeg" or "png"."""

    stamp_s: float
    data: bytes
    format: str = "jpeg"


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations of what an odometry says: of x and y each, of yaw, and of the two velocities."""

    position_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float


@dataclass(frozen=True, slots=True)
class Odometry:
    """nav_msgs/Odometry in the plane: pose in `odom`, velocity in `base_link`.

    `spread` is written for others, as covariances; what others write there is not read.
    """

    stamp_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float
    spread: Spread | None = None


@dataclass(frozen=True, slots=True)
class Imu:
    """sensor_msgs/Imu: yaw, yaw rate and the two planar accelerations."""

    stamp_s: float
    yaw_rad: float
    angular_rad_s: float
    linear_m_s2: float
    lateral_m_s2: float


@dataclass(frozen=True, slots=True)
class Range:
    """sensor_msgs/Range of one infrared ranger, REP-117."""

    stamp_s: float
    frame_id: str
    range_m: float
    min_range_m: float
    max_range_m: float


@dataclass(frozen=True, slots=True)
class BatteryState:
    """sensor_msgs/BatteryState: the CORE2 measures the voltage only."""

    stamp_s: float
    voltage_v: float


@dataclass(frozen=True, slots=True)
class Clock:
    """rosgraph_msgs/Clock: the robot's time. In lockstep it closes an observation: all its parts came before."""

    stamp_s: float


@dataclass(frozen=True, slots=True)
class Observation:
    """The newest of every sensor at `stamp_s`; a sensor that is absent or stale is None.

    `hal.bus.sensors` has a row for each. Pictures may come compressed, as they travelled.

    `seq` numbers observations; a command names the one it answers.
    """

    seq: int
    stamp_s: float
    scan: LaserScan | None = None
    image: Image | CompressedImage | None = None
    odom: Odometry | None = None
    imu: Imu | None = None
    battery: BatteryState | None = None
    ranges: tuple[Range, ...] = field(default=())
    depth: DepthImage | CompressedImage | None = None


@dataclass(frozen=True, slots=True)
class CourseState:
    """Ground truth about the drive that only a twin knows. For teachers, referees and plots, never for policies.

    `progress_m` runs along the course and grows over laps; `lateral_m` is the signed distance from it, left positive
    (both nan where a world has no line). `collided`, `lost` and `finished` hold for the present episode and latch.
    """

    stamp_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float
    progress_m: float
    lateral_m: float
    clearance_m: float
    collided: bool = False
    lost: bool = False
    finished: bool = False


# What a place in a twin's world is asked for with; beyond, nobody could have meant it.
Seed = Annotated[int, Meta(ge=0, lt=2**32)]
Along = Annotated[float, Meta(ge=-1e6, le=1e6)]
Aside = Annotated[float, Meta(ge=-1e3, le=1e3)]


@dataclass(frozen=True, slots=True)
class Episode:
    """A fresh start in a twin's world. Its bounds hold for one that is asked for over the bus.

    `layout` seeds everything random in the world; `start_m` is where on the course the robot is put down
    (0: the world's own start), `lateral_m` and `yaw_rad` how far off it, relative to the course. `began_m` is where the
    lap began that this goes on with, after a crash; None if it begins here.
    """

    layout: Seed = 0
    start_m: Along = 0.0
    lateral_m: Aside = 0.0
    yaw_rad: Aside = 0.0
    began_m: Along | None = None


Action = tuple[float, float]
"""A normalised command (linear, angular), each in [-1, 1]: a fraction of the profile's limits."""
