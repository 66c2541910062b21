"""What a robot says, as a ROS graph gets it: the same messages to the byte, of each as much as somebody listens to."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.reader import Reader
from lira.hal.bus.sensors import SENSORS, sensors_of
from lira.hal.bus.topics import (
    CLOCK,
    COMMANDS,
    DEPTH_INFO,
    DIAGNOSTICS,
    FROM_OPERATORS,
    PICTURE,
    SIM_STATE,
    TOPICS,
    Topic,
)
from lira.hal.profile import RobotProfile
from lira.hal.ros_graph.node import RosNode

NEWEST = 16  # messages of a topic between two looks; of pictures one
ABSOLUTE = (DIAGNOSTICS,)  # has one name in ROS, whatever the namespace


def said_by(profile: RobotProfile, *, arena: bool) -> list[Topic[Any]]:
    """The topics on which a robot itself says something; `arena`: it is a twin."""
    lacks: set[str] = {sensor.topic.key for sensor in SENSORS} - {sensor.topic.key for sensor in sensors_of(profile)}
    lacks |= {topic.key for topic in (*COMMANDS, *FROM_OPERATORS, CLOCK)} - {DIAGNOSTICS.key}
    if profile.depth is None:
        lacks.add(DEPTH_INFO.key)
    if not arena:
        lacks.add(SIM_STATE.key)
    return [topic for topic in TOPICS if topic.key not in lacks]


class Telemetry:
    """Relays it from the robot's bus to a node of the graph."""

    def __init__(self, bus: Bus, node: RosNode, topics: Iterable[Topic[Any]]) -> None:
        self._bus = bus
        self._boundary = node.boundary
        self._topics = {topic.key: topic for topic in topics}
        self._publishers: dict[str, Publisher[Any]] = {
            key: node.publisher(replace(topic, key=f"/{key}") if topic in ABSOLUTE else topic)
            for key, topic in self._topics.items()
        }
        self._readers: dict[str, Reader[Any]] = {}
        self.look()

    def look(self) -> None:
        """Fetch what somebody in the graph listens to, and what late subscribers get, and nothing else."""
        for key, topic in self._topics.items():
            with self._boundary.guard(key):  # a session that is just being replaced cannot tell
                if not (topic.qos.latched or self._publishers[key].matching):
                    self._readers.pop(key, None)  # its subscription goes with it
                elif key not in self._readers:
                    self._readers[key] = self._bus.reader(topic, 1 if topic.qos == PICTURE else NEWEST)

    def relay(self) -> None:
        """Pass on what came."""
        for key, reader in self._readers.items():
            for received in reader.poll():
                with self._boundary.guard(key):
                    self._publishers[key].put_encoded(received.payload, 0.0)
