"""Our messages as ROS 2 messages: one pair of functions for each, and the table of them.

The definitions are those of ROS 2 Jazzy, plus our own in `hal/msg`, registered as package `lira_msgs`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from hal.messages import (
    Action,
    Applied,
    BatteryState,
    Bool,
    Clock,
    CompressedImage,
    CourseState,
    Decision,
    DiagnosticArray,
    DiagnosticStatus,
    ExpertView,
    Image,
    Imu,
    Joy,
    JoyFeedback,
    LabelCounts,
    LaserScan,
    Odometry,
    Range,
    Reason,
    Source,
    Twist,
)
from hal.pictures import is_sound

PACKAGE = "lira_msgs"
CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "mono8": 1}


def _load_types() -> Typestore:
    store = get_typestore(Stores.ROS2_JAZZY)
    for entry in sorted((resources.files("hal") / "msg").iterdir(), key=lambda entry: entry.name):
        if entry.name.endswith(".msg"):
            name = f"{PACKAGE}/msg/{entry.name.removesuffix('.msg')}"
            store.register(get_types_from_msg(entry.read_text(encoding="utf-8"), name))
    return store


TYPES = _load_types()


def definition(ros_type: str) -> str:
    """Text of a message definition with all it refers to, as MCAP's schema encoding `ros2msg` wants it."""
    text, _ = TYPES.generate_msgdef(ros_type, ros_version=2)
    return text


def _ros(name: str) -> Callable[..., Any]:
    return TYPES.types[name]


_Time = _ros("builtin_interfaces/msg/Time")
_Header = _ros("std_msgs/msg/Header")
_Vector3 = _ros("geometry_msgs/msg/Vector3")
_Quaternion = _ros("geometry_msgs/msg/Quaternion")
_Point = _ros("geometry_msgs/msg/Point")
_Twist = _ros("geometry_msgs/msg/Twist")
_Pose = _ros("geometry_msgs/msg/Pose")
_PoseWithCovariance = _ros("geometry_msgs/msg/PoseWithCovariance")
_TwistWithCovariance = _ros("geometry_msgs/msg/TwistWithCovariance")

_NO_COVARIANCE_36 = np.zeros(36)
_NO_COVARIANCE_9 = np.zeros(9)
_NOTHING = np.empty(0, np.float32)
_ZERO = _Vector3(0.0, 0.0, 0.0)


def _time(stamp_s: float) -> Any:
    sec, nanosec = divmod(round(stamp_s * 1e9), 1_000_000_000)
    return _Time(sec, nanosec)


def _header(stamp_s: float, frame_id: str) -> Any:
    return _Header(_time(stamp_s), frame_id)


def _seconds(time: Any) -> float:
    return float((time.sec * 1_000_000_000 + time.nanosec) / 1e9)


def _stamp(ros: Any) -> float:
    return _seconds(ros.header.stamp)


def _yaw_to(yaw_rad: float) -> Any:
    return _Quaternion(0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))


def _yaw_from(q: Any) -> float:
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def _twist_to(m: Twist) -> Any:
    return _Twist(_Vector3(m.linear_m_s, 0.0, 0.0), _Vector3(0.0, 0.0, m.angular_rad_s))


def _twist_from(ros: Any) -> Twist:
    return Twist(ros.linear.x, ros.angular.z)


def _clock_to(m: Clock) -> Any:
    return _ros("rosgraph_msgs/msg/Clock")(_time(m.stamp_s))


def _clock_from(ros: Any) -> Clock:
    return Clock(_seconds(ros.clock))


def _applied_to(m: Applied) -> Any:
    return _ros("lira_msgs/msg/Applied")(
        _header(m.stamp_s, "base_link"),
        _twist_to(m.twist),
        m.source.value,
        m.reason.value,
        list(m.clamps),
        m.answers,
        m.command_age_s,
        m.epoch,
        m.seq,
    )


def _applied_from(ros: Any) -> Applied:
    return Applied(
        _twist_from(ros.twist),
        _stamp(ros),
        Source(ros.source),
        Reason(ros.reason),
        tuple(ros.clamps),
        ros.answers,
        ros.command_age_s,
        ros.epoch,
        ros.seq,
    )


def _diagnostics_to(m: DiagnosticArray) -> Any:
    status, pair = _ros("diagnostic_msgs/msg/DiagnosticStatus"), _ros("diagnostic_msgs/msg/KeyValue")
    return _ros("diagnostic_msgs/msg/DiagnosticArray")(
        _header(m.stamp_s, ""),
        [status(s.level, s.name, s.message, "", [pair(key, value) for key, value in s.values]) for s in m.status],
    )


def _diagnostics_from(ros: Any) -> DiagnosticArray:
    return DiagnosticArray(
        _stamp(ros),
        tuple(
            DiagnosticStatus(s.level, s.name, s.message, tuple((v.key, v.value) for v in s.values)) for s in ros.status
        ),
    )


def _bool_to(m: Bool) -> Any:
    return _ros("std_msgs/msg/Bool")(m.data)


def _bool_from(ros: Any) -> Bool:
    return Bool(bool(ros.data))


def _joy_to(m: Joy) -> Any:
    return _ros("sensor_msgs/msg/Joy")(
        _header(m.stamp_s, "joy"), np.array(m.axes, np.float32), np.array(m.buttons, np.int32)
    )


def _joy_from(ros: Any) -> Joy:
    return Joy(_stamp(ros), tuple(map(float, ros.axes)), tuple(map(int, ros.buttons)))


def _feedback_to(m: JoyFeedback) -> Any:
    return _ros("sensor_msgs/msg/JoyFeedback")(m.type, m.id, m.intensity)


def _feedback_from(ros: Any) -> JoyFeedback:
    return JoyFeedback(ros.type, ros.id, ros.intensity)


def _scan_to(m: LaserScan) -> Any:
    return _ros("sensor_msgs/msg/LaserScan")(
        _header(m.stamp_s, "laser"),
        m.angle_min,
        m.angle_min + m.angle_increment * max(len(m.ranges) - 1, 0),
        m.angle_increment,
        m.time_increment,
        m.scan_time,
        m.range_min,
        m.range_max,
        np.ascontiguousarray(m.ranges, np.float32),
        _NOTHING,
    )


def _scan_from(ros: Any) -> LaserScan:
    return LaserScan(
        _stamp(ros),
        ros.angle_min,
        ros.angle_increment,
        ros.range_min,
        ros.range_max,
        np.array(ros.ranges, np.float32),  # a copy: aligned, and free of the payload
        ros.scan_time,
        ros.time_increment,
    )


def _image_to(m: Image) -> Any:
    height, width = m.data.shape[:2]
    data = np.ascontiguousarray(m.data, np.uint8).reshape(-1)
    if data.size != height * width * CHANNELS[m.encoding]:
        raise ValueError(f"shape {m.data.shape} does not fit encoding {m.encoding}")
    step = width * CHANNELS[m.encoding]
    return _ros("sensor_msgs/msg/Image")(_header(m.stamp_s, "camera"), height, width, m.encoding, False, step, data)


def _image_from(ros: Any) -> Image:
    channels = CHANNELS[ros.encoding]
    if ros.step != ros.width * channels or ros.data.size != ros.height * ros.step:
        raise ValueError(f"{ros.data.size} bytes for {ros.height} rows of {ros.step}")
    shape = (ros.height, ros.width) if channels == 1 else (ros.height, ros.width, channels)
    return Image(_stamp(ros), np.array(ros.data, np.uint8).reshape(shape), ros.encoding)


def _compressed_to(m: CompressedImage) -> Any:
    return _ros("sensor_msgs/msg/CompressedImage")(
        _header(m.stamp_s, "camera"), m.format, np.frombuffer(m.data, np.uint8)
    )


def _compressed_from(ros: Any) -> CompressedImage:
    data = ros.data.tobytes()
    if not is_sound(data):
        raise ValueError("a part of the picture is longer than the picture")
    return CompressedImage(_stamp(ros), data, ros.format)


def _odometry_to(m: Odometry) -> Any:
    pose = _Pose(_Point(m.x_m, m.y_m, 0.0), _yaw_to(m.yaw_rad))
    twist = _twist_to(Twist(m.linear_m_s, m.angular_rad_s))
    return _ros("nav_msgs/msg/Odometry")(
        _header(m.stamp_s, "odom"),
        "base_link",
        _PoseWithCovariance(pose, _NO_COVARIANCE_36),
        _TwistWithCovariance(twist, _NO_COVARIANCE_36),
    )


def _odometry_from(ros: Any) -> Odometry:
    pose, twist = ros.pose.pose, ros.twist.twist
    return Odometry(
        _stamp(ros), pose.position.x, pose.position.y, _yaw_from(pose.orientation), twist.linear.x, twist.angular.z
    )


def _imu_to(m: Imu) -> Any:
    return _ros("sensor_msgs/msg/Imu")(
        _header(m.stamp_s, "imu_link"),
        _yaw_to(m.yaw_rad),
        _NO_COVARIANCE_9,
        _Vector3(0.0, 0.0, m.angular_rad_s),
        _NO_COVARIANCE_9,
        _Vector3(m.linear_m_s2, m.lateral_m_s2, 0.0),
        _NO_COVARIANCE_9,
    )


def _imu_from(ros: Any) -> Imu:
    acceleration = ros.linear_acceleration
    return Imu(_stamp(ros), _yaw_from(ros.orientation), ros.angular_velocity.z, acceleration.x, acceleration.y)


def _range_to(m: Range) -> Any:
    infrared, field_of_view_rad = 1, 0.26
    return _ros("sensor_msgs/msg/Range")(
        _header(m.stamp_s, m.frame_id),
        infrared,
        field_of_view_rad,
        m.min_range_m,
        m.max_range_m,
        m.range_m,
        0.0,
    )


def _range_from(ros: Any) -> Range:
    return Range(_stamp(ros), ros.header.frame_id, ros.range, ros.min_range, ros.max_range)


def _battery_to(m: BatteryState) -> Any:
    unmeasured, unknown, lithium_ion = math.nan, 0, 2
    return _ros("sensor_msgs/msg/BatteryState")(
        header=_header(m.stamp_s, "base_link"),
        voltage=m.voltage_v,
        temperature=unmeasured,
        current=unmeasured,
        charge=unmeasured,
        capacity=unmeasured,
        design_capacity=unmeasured,
        percentage=unmeasured,
        power_supply_status=unknown,
        power_supply_health=unknown,
        power_supply_technology=lithium_ion,
        present=True,
        cell_voltage=_NOTHING,
        cell_temperature=_NOTHING,
        location="",
        serial_number="",
    )


def _battery_from(ros: Any) -> BatteryState:
    return BatteryState(_stamp(ros), ros.voltage)


_COURSE_FIELDS = tuple(CourseState.__dataclass_fields__)[1:]
_COUNT_FIELDS = tuple(LabelCounts.__dataclass_fields__)


def _course_to(m: CourseState) -> Any:
    values = [getattr(m, name) for name in _COURSE_FIELDS]
    return _ros("lira_msgs/msg/CourseState")(_header(m.stamp_s, "odom"), *values)


def _course_from(ros: Any) -> CourseState:
    return CourseState(_stamp(ros), *(getattr(ros, name) for name in _COURSE_FIELDS))


def _action_from(values: Any) -> Action:
    return float(values[0]), float(values[1])


def _decision_to(m: Decision) -> Any:
    expert = _ros("lira_msgs/msg/ExpertView")
    return _ros("lira_msgs/msg/Decision")(
        header=_header(m.stamp_s, "base_link"),
        observation=m.observation,
        driver=m.driver,
        call=m.call,
        executed=np.array(m.executed, np.float64),
        novice=np.array(m.novice, np.float64),
        has_human=m.human is not None,
        human=np.array(m.human or (math.nan, math.nan), np.float64),
        experts=[expert(e.name, np.array(e.action, np.float64), e.activation, e.active) for e in m.experts],
        threshold=m.threshold,
        labels=_ros("lira_msgs/msg/LabelCounts")(*(getattr(m.labels, name) for name in _COUNT_FIELDS)),
        training_steps=m.training_steps,
        interventions=m.interventions,
        calls=m.calls,
        phase=m.phase,
        lap=m.lap,
    )


def _decision_from(ros: Any) -> Decision:
    return Decision(
        stamp_s=_stamp(ros),
        observation=ros.observation,
        driver=ros.driver,
        call=ros.call,
        executed=_action_from(ros.executed),
        novice=_action_from(ros.novice),
        human=_action_from(ros.human) if ros.has_human else None,
        experts=tuple(ExpertView(e.name, _action_from(e.action), e.activation, e.active) for e in ros.experts),
        threshold=ros.threshold,
        labels=LabelCounts(*(getattr(ros.labels, name) for name in _COUNT_FIELDS)),
        training_steps=ros.training_steps,
        interventions=ros.interventions,
        calls=ros.calls,
        phase=ros.phase,
        lap=ros.lap,
    )


@dataclass(frozen=True, slots=True)
class Codec:
    """How one of our messages becomes a ROS message, and back."""

    ros_type: str
    to_ros: Callable[[Any], Any]
    from_ros: Callable[[Any], Any]


CODECS: dict[type, Codec] = {
    Twist: Codec("geometry_msgs/msg/Twist", _twist_to, _twist_from),
    DiagnosticArray: Codec("diagnostic_msgs/msg/DiagnosticArray", _diagnostics_to, _diagnostics_from),
    Bool: Codec("std_msgs/msg/Bool", _bool_to, _bool_from),
    Clock: Codec("rosgraph_msgs/msg/Clock", _clock_to, _clock_from),
    Applied: Codec("lira_msgs/msg/Applied", _applied_to, _applied_from),
    Joy: Codec("sensor_msgs/msg/Joy", _joy_to, _joy_from),
    JoyFeedback: Codec("sensor_msgs/msg/JoyFeedback", _feedback_to, _feedback_from),
    LaserScan: Codec("sensor_msgs/msg/LaserScan", _scan_to, _scan_from),
    Image: Codec("sensor_msgs/msg/Image", _image_to, _image_from),
    CompressedImage: Codec("sensor_msgs/msg/CompressedImage", _compressed_to, _compressed_from),
    Odometry: Codec("nav_msgs/msg/Odometry", _odometry_to, _odometry_from),
    Imu: Codec("sensor_msgs/msg/Imu", _imu_to, _imu_from),
    Range: Codec("sensor_msgs/msg/Range", _range_to, _range_from),
    BatteryState: Codec("sensor_msgs/msg/BatteryState", _battery_to, _battery_from),
    CourseState: Codec("lira_msgs/msg/CourseState", _course_to, _course_from),
    Decision: Codec("lira_msgs/msg/Decision", _decision_to, _decision_from),
}
