"""What a robot says, as the ROS graph gets it: the same messages to the byte, of each as much as somebody listens to."""

from dataclasses import replace
from typing import Any

from lira.hal.bus.boundary import Boundary
from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.reader import Reader
from lira.hal.bus.topics import CLOCK, COMMANDS, DIAGNOSTICS, FROM_OPERATORS, PICTURE, TOPICS, Topic
from lira.hal.ros_graph.node import RosNode

DEPTH = 16  # messages of a topic between two looks; of pictures the newest alone
# What the robot itself says; in real time there is no clock to keep step with.
SAID: tuple[Topic[Any], ...] = tuple(
    topic for topic in TOPICS if topic not in (*COMMANDS, CLOCK) and (topic is DIAGNOSTICS or topic not in FROM_OPERATORS)
)
ABSOLUTE = (DIAGNOSTICS,)  # these have one name in ROS, whatever the namespace


class Telemetry:
    """Relays it from the robot's bus to a node of the graph."""

    def __init__(self, bus: Bus, node: RosNode) -> None:
        self._bus = bus
        self._boundary: Boundary = node.boundary
        self._publishers: dict[str, Publisher[Any]] = {topic.key: node.publisher(ros_topic(topic)) for topic in SAID}
        self._readers: dict[str, Reader[Any]] = {}
        self.look()

    def look(self) -> None:
        """Fetch what somebody in the graph listens to, and what late subscribers get, and nothing else."""
        for topic in SAID:
            wanted = topic.qos.latched or self._publishers[topic.key].matching
            if not wanted:
                self._readers.pop(topic.key, None)  # its subscription goes with it
            elif topic.key not in self._readers:
                self._readers[topic.key] = self._bus.reader(topic, 1 if topic.qos == PICTURE else DEPTH)

    def relay(self) -> None:
        """Pass on what came."""
        for key, reader in self._readers.items():
            for received in reader.poll():
                with self._boundary.guard(key):
                    self._publishers[key].put_encoded(received.payload, 0.0)


def ros_topic(topic: Topic[Any]) -> Topic[Any]:
    """A topic by the name that it has in ROS."""
    return replace(topic, key=f"/{topic.key}") if topic in ABSOLUTE else topic
