"""The types: those of ROS 2 that we speak (`jazzy.msg`), our own (`msg/`, package `lira_msgs`), and what most share.

The files of both lie beside the values. All of ROS 2 Jazzy's, which others may send, are loaded when somebody asks for
one: that takes as long as the rest of a start.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from lira.hal.messages import Twist
from lira.hal.messages.ros.msg_text import Definitions, read, read_all

PACKAGE = "lira_msgs"


@dataclass(frozen=True, slots=True)
class Codec:
    """How one of our messages becomes a ROS message, and back."""

    ros_type: str
    to_ros: Callable[[Any], Any]
    from_ros: Callable[[Any], Any]


def _own() -> Definitions:
    definitions: Definitions = {}
    for entry in sorted((resources.files("lira.hal.messages") / "msg").iterdir(), key=lambda entry: entry.name):
        if entry.name.endswith(".msg"):
            name = f"{PACKAGE}/msg/{entry.name.removesuffix('.msg')}"
            definitions |= read(entry.read_text(encoding="utf-8"), name)
    return definitions


def _spoken() -> Definitions:
    return read_all((resources.files("lira.hal.messages") / "jazzy.msg").read_text(encoding="utf-8"))


def _load_types() -> Typestore:
    store = get_typestore(Stores.EMPTY)
    store.register(_spoken() | _own())
    return store


TYPES = _load_types()


@cache
def all_types() -> Typestore:
    """All types of ROS 2 Jazzy, and our own."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(_own())
    return store


def types_with(ros_type: str) -> Typestore | None:
    """Return types among which this one is, by a name such as `sensor_msgs/msg/Image`; None if nobody here knows it."""
    if ros_type in TYPES.types:
        return TYPES
    return all_types() if ros_type in all_types().types else None


def definition(ros_type: str) -> str:
    """Text of a message definition with all it refers to, as MCAP's schema encoding `ros2msg` wants it.

    Empty for a type that nobody here knows.
    """
    types = types_with(ros_type)
    return "" if types is None else types.generate_msgdef(ros_type, ros_version=2)[0]


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
