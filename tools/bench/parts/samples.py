"""One or more of every message that travels: what the fuzz bench spoils and the codec's tests send round."""

import math

import numpy as np

from lira.hal.messages import (
    Applied,
    BatteryState,
    Bool,
    Call,
    CallName,
    CameraInfo,
    Clock,
    CompressedImage,
    CourseState,
    Decision,
    DepthImage,
    DiagnosticArray,
    DiagnosticStatus,
    Driver,
    ExpertView,
    FeatureArray,
    Image,
    Imu,
    Joy,
    JoyFeedback,
    LabelCounts,
    LaserScan,
    MethodCall,
    MethodCalls,
    Odometry,
    OperatorAnswer,
    OperatorRequest,
    Phase,
    Range,
    Reason,
    Request,
    SessionState,
    Source,
    Stage,
    Text,
    Transform,
    Transforms,
    Twist,
    TwistStamped,
)
from lira.hal.messages.compression import compress, compress_depth

NAN, INF = math.nan, math.inf

EXPERTS = (ExpertView("camera", (0.5, -1.0), 0.07, True), ExpertView("lidar", (1.0, 0.25), 0.0, False))
DECISION = Decision(
    7.25,
    12,
    "camera",
    Call.ATTENTION,
    (0.5, -1.0),
    (0.25, 0.0),
    None,
    EXPERTS,
    0.06,
    LabelCounts(1, 2, 3, 4, 5),
    2,
    3,
    4,
)
MESSAGES: list[object] = [
    Twist(0.5, -1.5),
    Twist(NAN, INF),
    TwistStamped(2.5, Twist(0.5, -1.5)),
    Clock(1.25),
    Applied(Twist(0.1, 0.2), 3.5),
    Applied(Twist(0.1, 0.2), 3.5, Source.TELEOP, Reason.OK, ("linear", "angular"), 77, 0.125, 2**64 - 1, 9),
    LaserScan(2.5, -1.0, 0.25, 0.0625, 4.0, np.array([1.0, INF, -INF, NAN, 0.5], np.float32), 0.125, 0.25),
    LaserScan(2.5, -1.0, 0.25, 0.0625, 4.0, np.empty(0, np.float32)),
    Image(1.0, np.arange(24, dtype=np.uint8).reshape(2, 4, 3)),
    Image(1.0, np.arange(6, dtype=np.uint8).reshape(2, 3), "mono8"),
    CompressedImage(1.0, b"\xff\xd8 not really \xff\xd9", "jpeg"),
    compress(Image(1.0, np.arange(48, dtype=np.uint8).reshape(4, 4, 3)), "png"),
    compress_depth(DepthImage(1.0, np.arange(16, dtype=np.uint16).reshape(4, 4))),
    Odometry(1.5, 1.0, -2.0, 0.75, 0.5, -0.25),
    Transforms(1.5, (Transform("odom", "base_link", (1.0, -2.0, 0.0), (0.0, 0.0, 0.6, 0.8)),)),
    Transforms(0.0, ()),
    Text("<robot name='x'/>"),
    CameraInfo(1.5, 4, 3, (2.0, 0.0, 1.5, 0.0, 2.0, 1.0, 0.0, 0.0, 1.0), (0.5,) * 12, (0.1, 0.0, 0.0, 0.0, 0.0)),
    Imu(1.5, -0.75, 0.5, 9.0, -9.0),
    Range(1.5, "range_fl", 0.5, 0.03125, 0.875),
    Range(1.5, "range_rr", INF, 0.03125, 0.875),
    BatteryState(1.5, 11.5),
    CourseState(1.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -0.5, 0.25, True, False, True),
    CourseState(1.5, 1.0, 2.0, 3.0, 4.0, 5.0, NAN, NAN, INF),
    DECISION,
    Decision(
        *(7.25, 12, Driver.HUMAN, Call.NONE, (0.5, -1.0), (0.25, 0.0), (0.5, -1.0), (), 0.06),
        *(LabelCounts(), 0, 0, 0, Phase.UNSEEN, 3),
    ),
    DiagnosticArray(1.5, (DiagnosticStatus(1, "a", "b", (("c", "d"),)), DiagnosticStatus(0, "e", "f"))),
    Bool(True),
    Joy(1.5, (0.5, -1.0), (1, 0, 1)),
    OperatorRequest(Request.PAUSE),
    OperatorRequest(Request.HANDOVER, "camera"),
    OperatorAnswer(1.5),
    MethodCalls(
        2.5,
        (
            MethodCall(CallName.UPDATE, 0, 2.4, outcome='{"labels":1}'),
            MethodCall(CallName.PROPOSE, 0, features=(FeatureArray("image", b"\0\7\xff"), FeatureArray("scan", b""))),
            MethodCall(CallName.LEARN, 0, action=(1.0, -0.5)),
            MethodCall(CallName.CHOOSE, 2, argument="camera"),
        ),
    ),
    SessionState(1.5, Stage.PROVING, "ada", 3, 2, 1, 4, 5, 60, 7, 6, 0.75, (0.5, 1.0), 2, 3, "It drove 2 of 3"),
    OperatorAnswer(1.5, True, 3, False, "no expert is called 'sonar'"),
    JoyFeedback(JoyFeedback.TYPE_RUMBLE, 10, 0.5),
    Bool(False),
]


def of_kind(kind: type) -> list[object]:
    """Those of one kind."""
    return [message for message in MESSAGES if type(message) is kind]
