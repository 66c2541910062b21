"""The one table of topics: key, message, rate, age at which it counts as stale, and how it travels.

Keys lie below the robot's name. Whether a value is fresh is decided from this table and nowhere else.
"""

from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from zenoh import Priority, Reliability

from lira.hal.messages import (
    STOP,
    Applied,
    BatteryState,
    Bool,
    CameraInfo,
    Clock,
    CompressedImage,
    CourseState,
    Decision,
    DiagnosticArray,
    Imu,
    Joy,
    JoyFeedback,
    LaserScan,
    MethodCalls,
    Odometry,
    OperatorAnswer,
    OperatorRequest,
    Range,
    SessionState,
    Text,
    Transforms,
    Twist,
    TwistStamped,
)
from lira.hal.messages.ros.codec import fixed_bytes, ros_type_of

M = TypeVar("M")


@dataclass(frozen=True, slots=True)
class Qos:
    """How samples travel. `latched`: a late reader gets the last one. `wait`: rather than drop what does not fit."""

    reliability: Reliability
    priority: Priority
    express: bool = False
    latched: bool = False
    wait: bool = False


# What must be new or not come at all: over UDP, past everything else.
URGENT = Qos(Reliability.BEST_EFFORT, Priority.REAL_TIME, express=True)
SENSOR = Qos(Reliability.BEST_EFFORT, Priority.DATA_HIGH, express=True)
# An image is many packets, so over TCP, and it gives way first.
PICTURE = Qos(Reliability.RELIABLE, Priority.DATA_LOW)
REPORT = Qos(Reliability.RELIABLE, Priority.DATA)
LATCHED = Qos(Reliability.RELIABLE, Priority.DATA, latched=True)
# Lockstep: nothing is lost and nothing overtakes, so one link and one priority. To wait is harmless when time waits.
IN_LOCKSTEP = Qos(Reliability.RELIABLE, Priority.DATA, express=True, wait=True)


# No payload is longer: what is, is dropped before anybody copies it.
PICTURE_BYTES = 2 * 2**20
SCAN_BYTES = 160 * 2**10  # of `hal.bounds.MOST_BEAMS` beams with intensities
REPORT_BYTES = 64 * 2**10
CALLS_BYTES = 256 * 2**10  # what a method saw in a step, or some labels from before
SMALL_BYTES = 2 * 2**10  # numbers, a header and a few short texts
COMMAND_BYTES = 256  # a TwistStamped whose frame has a name
ATTACHMENT_BYTES = 256  # ours and those of ROS peers
QUESTION_BYTES = 4 * 2**10
MESSAGE_BYTES = 4 * 2**20  # of anything at all


@dataclass(frozen=True, slots=True)
class Topic(Generic[M]):
    """One line of the table. `max_bytes`: no payload is longer. A rate of 0: once, when the robot starts.

    `stamped`: a ROS peer may send that instead, which is longer than any of `kind`, and than `plain_bytes`.
    """

    key: str
    kind: type[M]
    rate_hz: float
    max_age_s: float
    qos: Qos
    max_bytes: int = SMALL_BYTES
    stamped: type[Any] | None = None
    plain_bytes: int = 0

    @property
    def ros_type(self) -> str:
        """Name of the ROS type of the payload."""
        return ros_type_of(self.kind)


SCAN = Topic("scan", LaserScan, 10.0, 0.3, SENSOR, SCAN_BYTES)
CAMERA = Topic("camera/color/image_raw/compressed", CompressedImage, 30.0, 0.3, PICTURE, PICTURE_BYTES)
DEPTH = Topic("camera/depth/image_raw/compressed", CompressedImage, 5.0, 0.6, PICTURE, PICTURE_BYTES)  # if asked for
ODOM = Topic("odom", Odometry, 20.0, 0.3, URGENT)
IMU = Topic("imu", Imu, 10.0, 0.3, SENSOR)
RANGES = {
    frame_id: Topic(frame_id.replace("_", "/"), Range, 10.0, 0.3, SENSOR)
    for frame_id in ("range_fl", "range_fr", "range_rl", "range_rr")
}
BATTERY = Topic("battery", BatteryState, 1.0, 5.0, LATCHED)
TF = Topic("tf", Transforms, 20.0, 0.3, REPORT)  # with each odometry; reliable, as ROS's listeners ask for
TF_STATIC = Topic("tf_static", Transforms, 0.0, float("inf"), LATCHED, REPORT_BYTES)
DESCRIPTION = Topic("robot_description", Text, 0.0, float("inf"), LATCHED, REPORT_BYTES)
CAMERA_INFO = Topic("camera/color/camera_info", CameraInfo, 30.0, 0.3, REPORT)  # with each picture
DEPTH_INFO = Topic("camera/depth/camera_info", CameraInfo, 5.0, 0.6, REPORT)
CMD_VEL = Topic("cmd_vel", Twist, 20.0, 0.3, URGENT, COMMAND_BYTES, TwistStamped, fixed_bytes(STOP))
TELEOP = Topic("cmd_vel/teleop", Twist, 30.0, 0.2, URGENT, COMMAND_BYTES, TwistStamped, fixed_bytes(STOP))
APPLIED = Topic("cmd_vel/applied", Applied, 20.0, 0.3, URGENT)
ESTOP = Topic("estop", Bool, 1.0, float("inf"), LATCHED, fixed_bytes(Bool(False)))  # true presses
JOY = Topic("joy", Joy, 30.0, 0.2, SENSOR)
JOY_FEEDBACK = Topic("joy/feedback", JoyFeedback, 10.0, 0.2, REPORT)
OPERATOR = Topic("operator", OperatorRequest, 5.0, 1.0, REPORT)  # asked later than this counts for nothing
OPERATOR_ANSWER = Topic("operator/answer", OperatorAnswer, 1.0, 3.0, REPORT, REPORT_BYTES)
DECISION = Topic("lira/decision", Decision, 5.0, 1.0, REPORT, REPORT_BYTES)
METHOD = Topic("lira/method", MethodCalls, 5.0, 1.0, REPORT, CALLS_BYTES)
SESSION = Topic("lira/session", SessionState, 1.0, 3.0, REPORT, REPORT_BYTES)
DIAGNOSTICS = Topic("diagnostics", DiagnosticArray, 1.0, 3.0, REPORT, REPORT_BYTES)
SIM_STATE = Topic("sim/state", CourseState, 20.0, 0.3, SENSOR)
CLOCK = Topic("clock", Clock, 20.0, 0.3, URGENT, fixed_bytes(Clock(0.0)))  # lockstep only: closes an observation

COMMANDS: tuple[Topic[Twist], ...] = (CMD_VEL, TELEOP)
# What operators tell; all else on the bus, but commands, the robot says alone.
FROM_OPERATORS: tuple[Topic[Any], ...] = (
    ESTOP,
    JOY,
    JOY_FEEDBACK,
    OPERATOR,
    OPERATOR_ANSWER,
    DECISION,
    METHOD,
    SESSION,
    DIAGNOSTICS,
)

TOPICS: tuple[Topic[Any], ...] = (
    SCAN,
    CAMERA,
    DEPTH,
    ODOM,
    IMU,
    *RANGES.values(),
    BATTERY,
    TF,
    TF_STATIC,
    DESCRIPTION,
    CAMERA_INFO,
    DEPTH_INFO,
    *COMMANDS,
    APPLIED,
    *FROM_OPERATORS,
    SIM_STATE,
    CLOCK,
)

LATCHED_KEYS = frozenset(topic.key for topic in TOPICS if topic.qos.latched)  # sent once, for all who ever come

BY = "/by/"


def named(topic: Topic[M], commander: str) -> Topic[M]:
    """A topic of commands as one commander has it: with keys everybody commands in their own name, and in no other."""
    return replace(topic, key=f"{topic.key}{BY}{commander}")


# Keys that answer queries. What is a permission of its own is a key of its own.
INFO = "info"
RESET = "sim/reset"
ESTOP_PRESS = "estop/press"
ESTOP_RELEASE = "estop/release"
ESTOP_LOOK = "estop/look"
