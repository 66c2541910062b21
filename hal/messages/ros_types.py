"""The types: those of ROS 2 Jazzy and our own in `hal/msg` (package `lira_msgs`), and what most messages share."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from lira.hal.messages import Twist

PACKAGE = "lira_msgs"


@dataclass(frozen=True, slots=True)
class Codec:
    """How one of our messages becomes a ROS message, and back."""

    ros_type: str
    to_ros: Callable[[Any], Any]
    from_ros: Callable[[Any], Any]


def _load_types() -> Typestore:
    store = get_typestore(Stores.ROS2_JAZZY)
    for entry in sorted((resources.files("lira.hal.messages") / "msg").iterdir(), key=lambda entry: entry.name):
        if entry.name.endswith(".msg"):
            name = f"{PACKAGE}/msg/{entry.name.removesuffix('.msg')}"
            store.register(get_types_from_msg(entry.read_text(encoding="utf-8"), name))
    return store


TYPES = _load_types()


def definition(ros_type: str) -> str:
    """Text of a message definition with all it refers to, as MCAP's schema encoding `ros2msg` wants it."""
    text, _ = TYPES.generate_msgdef(ros_type, ros_version=2)
    return text


def ros(name: str) -> Callable[..., Any]:
    """Constructor of a ROS type."""
    return TYPES.types[name]


_Time = ros("builtin_interfaces/msg/Time")
_Header = ros("std_msgs/msg/Header")
_Quaternion = ros("geometry_msgs/msg/Quaternion")
_Twist = ros("geometry_msgs/msg/Twist")
Vector3 = ros("geometry_msgs/msg/Vector3")


def time_to(stamp_s: float) -> Any:
    """Time of seconds."""
    sec, nanosec = divmod(round(stamp_s * 1e9), 1_000_000_000)
    return _Time(sec, nanosec)


def seconds(time: Any) -> float:
    """Seconds of a time. Raises `ValueError` for one that no clock shows."""
    if time.nanosec >= 1_000_000_000:
        raise ValueError(f"{time.sec} s and {time.nanosec} ns are no time")
    return float((time.sec * 1_000_000_000 + time.nanosec) / 1e9)


def header(stamp_s: float, frame_id: str) -> Any:
    """Header of a time and a frame."""
    return _Header(time_to(stamp_s), frame_id)


def stamp(message: Any) -> float:
    """Seconds in a message's header."""
    return seconds(message.header.stamp)


def yaw_to(yaw_rad: float) -> Any:
    """Quaternion of a yaw."""
    return _Quaternion(0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))


def yaw_from(q: Any) -> float:
    """Yaw of a quaternion."""
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def twist_to(m: Twist) -> Any:
    """Velocity in the plane, as ROS has it."""
    return _Twist(Vector3(m.linear_m_s, 0.0, 0.0), Vector3(0.0, 0.0, m.angular_rad_s))


def twist_from(message: Any) -> Twist:
    """Velocity in the plane; the rest of it is nothing that wheels can do."""
    return Twist(message.linear.x, message.angular.z)
