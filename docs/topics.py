"""Writes the bus's topics as a table: keys, types, rates, and the hashes by which ROS 2 knows a type."""

from zenoh import Reliability

from lira.hal.bus.topics import TOPICS, Qos, Topic
from lira.hal.messages.ros.codec import ros_type_of
from lira.hal.messages.ros.types import PACKAGE, TYPES
from lira.hal.rmw.hashes import type_hash


def topic_table() -> str:
    """Return one row for each topic."""
    head = "| key | type | Hz | stale after | at most | travels |\n|---|---|---|---|---|---|\n"
    return head + "".join(_row(topic) for topic in TOPICS)


def hash_table() -> str:
    """Return one row for each type on the bus, and each of ours."""
    types = {topic.ros_type for topic in TOPICS} | {ros_type_of(topic.stamped) for topic in TOPICS if topic.stamped}
    types |= {name for name in TYPES.types if name.startswith(f"{PACKAGE}/")}
    return "| type | RIHS01 |\n|---|---|\n" + "".join(f"| `{name}` | `{_hash(name)}` |\n" for name in sorted(types))


def _row(topic: Topic[object]) -> str:
    age = "never" if topic.max_age_s == float("inf") else f"{topic.max_age_s:g} s"
    cells = [
        f"`{topic.key}`",
        f"`{topic.ros_type}`" + ("" if topic.stamped is None else f" or `{topic.stamped.__name__}`"),
        f"{topic.rate_hz:g}" if topic.rate_hz else "once",
        age,
        _size(topic.max_bytes),
        _way(topic.qos),
    ]
    return f"| {' | '.join(cells)} |\n"


def _size(count: int) -> str:
    return f"{count} B" if count < 1024 else f"{count // 1024} KiB"


def _way(qos: Qos) -> str:
    link = "datagram" if qos.reliability == Reliability.BEST_EFFORT else "stream"
    priority = str(qos.priority).rpartition(".")[2].lower().replace("_", " ")
    return ", ".join([link, priority, *(["latched"] if qos.latched else [])])


def _hash(ros_type: str) -> str:
    return type_hash(ros_type).removeprefix("RIHS01_")
