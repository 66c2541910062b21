"""The two forms in which a robot that runs ROS 2 is on zenoh, and what both can do."""

from dataclasses import dataclass
from typing import Protocol, TypeVar

from lira.hal.bus.boundary import Boundary
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.reader import Reader
from lira.hal.bus.topics import Topic

M = TypeVar("M")


class Transport(Protocol):
    """What carries its topics: a `Bus` with its namespace for prefix, or a `RosNode` in its graph."""

    endpoint: str
    boundary: Boundary

    def reader(self, topic: Topic[M], depth: int = 1) -> Reader[M]:
        """Hear a topic, by its ROS name."""

    def publisher(self, topic: Topic[M]) -> Publisher[M]:
        """Say something on one."""

    def peers(self) -> int:
        """How many others are connected."""


@dataclass(frozen=True, slots=True)
class Form:
    """How to speak of one: who answers at the address, which program that is, what to do about a silent topic."""

    nobody: str
    program: str
    silent: str


LOOK = "`lira ros2 --look` lists what comes; name the topic with --topic NAME=ROS_TOPIC."
BRIDGE = Form("bridge", "zenoh-bridge-ros2dds", f"Does zenoh-bridge-ros2dds let this topic through? {LOOK}")
RMW = Form(
    "router of rmw_zenoh",
    "rmw_zenohd",
    f"Does a node publish it in this domain, with RMW_IMPLEMENTATION=rmw_zenoh_cpp? {LOOK}",
)
