"""What the board says and is told: ROS 1 messages, through rosbags' typestore, as values of `hal.messages`."""

import math
import struct
from importlib import resources
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from lira.hal.errors import SensorError
from lira.hal.messages import BatteryState, Imu, Range, Twist
from lira.hal.messages.ros.msg_text import read_all
from lira.hal.messages.ros.types import yaw_from
from lira.robot.core2.wheels import Pose

# Before Noetic the battery's message had no temperatures.
OLD_BATTERY = """Header header
float32 voltage
float32 current
float32 charge
float32 capacity
float32 design_capacity
float32 percentage
uint8 power_supply_status
uint8 power_supply_health
uint8 power_supply_technology
bool present
float32[] cell_voltage
string location
string serial_number
"""
OLD_BATTERY = "lira/msg/OldBatteryState"

CONFIG_REQUEST_MD5 = "b116973260063b7b02b501a288810d3d"
CONFIG_ANSWER_MD5 = "d26ad64e1f52355ee24245b602a171ba"


def _load_types() -> Typestore:
    store = get_typestore(Stores.EMPTY)
    store.register(read_all((resources.files("lira.robot.core2") / "noetic.msg").read_text(encoding="utf-8")))
    return store


TYPES = _load_types()

# Layouts we read or write, by their MD5: that names a layout, a type's name does not.
LAYOUTS = {
    "9f195f881246fdfa2798d1d3eebca84a": "geometry_msgs/msg/Twist",
    "d3812c3cbc69362b77dc0b19b345f8f5": "geometry_msgs/msg/PoseStamped",
    "c005c34273dc426c67a020a87bc24148": "sensor_msgs/msg/Range",
    "6a62c6daae103f4ff57a132d6f95cec2": "sensor_msgs/msg/Imu",
    "7c8164229e7d2c17eb95e9231617fdee": "std_msgs/msg/UInt8",
    "4ddae7f048e32fda22cac764685e3974": "sensor_msgs/msg/BatteryState",
    "476f837fa6771f6e16e3bf4ef96f8770": OLD_BATTERY,
}

# What we read or write, and the MD5s it may have.
_BY_TOPIC = {
    "cmd_vel": {"geometry_msgs/msg/Twist"},
    "pose": {"geometry_msgs/msg/PoseStamped"},
    "velocity": {"geometry_msgs/msg/Twist"},
    "battery": {"sensor_msgs/msg/BatteryState", OLD_BATTERY},
    "imu": {"sensor_msgs/msg/Imu"},
    "buttons": {"std_msgs/msg/UInt8"},
    **{f"range/{corner}": {"sensor_msgs/msg/Range"} for corner in ("fl", "fr", "rl", "rr")},
}
NEEDED = ("cmd_vel", "pose", "velocity")

_MALFORMED = (
    *(SerdeError, struct.error, ArithmeticError, MemoryError),
    *(ValueError, TypeError, LookupError, AttributeError, AssertionError),
)


def layout_of(topic: str, md5: str) -> str | None:
    """Name the layout of a topic we know; None for a topic that does not matter, or a layout that is not its own."""
    layout = LAYOUTS.get(md5)
    return layout if layout in _BY_TOPIC.get(topic, set()) else None


def is_known(topic: str) -> bool:
    """Whether we read or write a topic of this name."""
    return topic in _BY_TOPIC


def decode(layout: str, payload: bytes) -> Any:
    """Read a ROS 1 message. Raises `SensorError` for what is none."""
    try:
        return TYPES.deserialize_ros1(payload, layout)
    except _MALFORMED as error:
        raise SensorError(f"{len(payload)} bytes of the board are no {layout}: {error}") from error


def encode_twist(twist: Twist) -> bytes:
    """Write a velocity; 48 bytes."""
    vector = TYPES.types["geometry_msgs/msg/Vector3"]
    message = TYPES.types["geometry_msgs/msg/Twist"](
        vector(twist.linear_m_s, 0.0, 0.0), vector(0.0, 0.0, twist.angular_rad_s)
    )
    return bytes(TYPES.serialize_ros1(message, "geometry_msgs/msg/Twist"))


def pose_of(message: Any) -> Pose:
    """Pose of a PoseStamped."""
    position = message.pose.position
    return Pose(position.x, position.y, yaw_from(message.pose.orientation))


def imu_of(message: Any, stamp_s: float) -> Imu:
    """Reading of the IMU."""
    acceleration = message.linear_acceleration
    return Imu(stamp_s, yaw_from(message.orientation), message.angular_velocity.z, acceleration.x, acceleration.y)


def range_of(message: Any, topic: str, stamp_s: float) -> Range:
    """Reading of a ranger, after REP-117: what the firmware gives as -1 is no measurement."""
    range_m = float(message.range)
    if not range_m >= 0.0:
        range_m = math.nan
    elif range_m < message.min_range:
        range_m = -math.inf
    elif range_m > message.max_range:
        range_m = math.inf
    return Range(stamp_s, topic.replace("/", "_"), range_m, float(message.min_range), float(message.max_range))


def battery_of(message: Any, stamp_s: float) -> BatteryState:
    """Voltage of the battery."""
    return BatteryState(stamp_s, float(message.voltage))
