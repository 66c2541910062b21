"""Writes what a robot of ours is in a ROS 2 graph: topics that it says and hears, services, frames."""

from typing import Any

from lira.hal.bus.topics import (
    CLOCK,
    COMMANDS,
    ESTOP,
    ESTOP_LOOK,
    ESTOP_PRESS,
    ESTOP_RELEASE,
    FROM_OPERATORS,
    RESET,
    TOPICS,
    Topic,
)
from lira.hal.description.frames import mounts_of
from lira.hal.messages.ros.codec import ros_type_of
from lira.hal.profile import load_profile
from lira.hal.rmw.hashes import type_hash
from lira.hal.rmw.services import TRIGGER
from lira.hal.ros_graph.node import SERVICE_QOS, ros_qos

HEAD = "| name | type | Hz | QoS | RIHS01 |\n|---|---|---|---|---|\n"
SERVICES = (ESTOP_PRESS, ESTOP_RELEASE, ESTOP_LOOK, RESET)


def said_table() -> str:
    """Return one row for each topic that comes from the robot, or from who teaches it."""
    told = {*(topic.key for topic in COMMANDS), ESTOP.key, CLOCK.key}
    operators = {topic.key for topic in FROM_OPERATORS}
    rows = [topic for topic in TOPICS if topic.key not in told and topic.key not in operators - {"diagnostics"}]
    rows += [topic for topic in TOPICS if topic.key in operators - told - {"diagnostics"}]
    return HEAD + "".join(_row(topic, topic.ros_type) for topic in rows)


def heard_table() -> str:
    """Return one row for each topic and type that the robot obeys."""
    rows = [(topic, kind) for topic in COMMANDS for kind in (topic.kind, topic.stamped) if kind is not None]
    return HEAD + "".join(_row(topic, ros_type_of(kind)) for topic, kind in [*rows, (ESTOP, ESTOP.kind)])


def service_table() -> str:
    """Return one row for each service."""
    qos, hashed = str(SERVICE_QOS), _hash(TRIGGER)
    head = "| name | type | QoS | RIHS01 |\n|---|---|---|---|\n"
    return head + "".join(f"| `{name}` | `{TRIGGER}` | {qos} | `{hashed}` |\n" for name in SERVICES)


def frame_table() -> str:
    """Return one row for each frame of a ROSbot."""
    head = "| frame | in | x, y, z (m) | roll, pitch, yaw (rad) |\n|---|---|---|---|\n"
    moving = "| `base_link` | `odom` | by odometry | |\n"
    rows = (
        f"| `{each.child}` | `{each.parent}` | {_numbers(each.xyz_m)} | {_numbers(each.rpy_rad)} |\n"
        for each in mounts_of(load_profile("rosbot2"))
    )
    return head + moving + "".join(rows)


def _row(topic: Topic[Any], ros_type: str) -> str:
    rate = f"{topic.rate_hz:g}" if topic.rate_hz else "once"
    return f"| `{topic.key}` | `{ros_type}` | {rate} | {ros_qos(topic)} | `{_hash(ros_type)}` |\n"


def _hash(ros_type: str) -> str:
    return type_hash(ros_type).removeprefix("RIHS01_")


def _numbers(values: tuple[float, float, float]) -> str:
    return ", ".join(f"{value:g}" for value in (round(value, 4) for value in values))
