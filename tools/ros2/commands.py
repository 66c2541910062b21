"""What a ROS graph commands, passed on to the robot: velocities with and without a stamp, and the emergency stop."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.reader import Reader, Received
from lira.hal.bus.topics import CMD_VEL, ESTOP, TELEOP, Topic
from lira.hal.messages import Bool, Twist, TwistStamped, is_neutral
from lira.hal.rmw.attachment import parse_rmw_attachment
from lira.hal.ros_graph.node import RosNode
from lira.tools.ros2.commanders import Commanders

DEPTH = 32
LARGEST_STAMPED = 1024  # bytes: a TwistStamped has a frame's name besides


class Commands:
    """Relays commands; `now` is the robot's clock, None while it is not known.

    A hand's zero means that it lets go, as it does on the bus from who cannot say so in another way.
    """

    def __init__(self, bus: Bus, node: RosNode, salt: bytes) -> None:
        self._ways = [
            _Way(bus, node, topic, Commanders(salt + topic.key.encode()), let_go=topic is TELEOP)
            for topic in (CMD_VEL, TELEOP)
        ]
        self._node = node
        self._estop = node.reader(ESTOP, DEPTH)
        self._press: Publisher[Bool] = bus.publisher(ESTOP)

    def relay(self, now: Callable[[float], float | None]) -> None:
        """Pass on what came; `now` returns the robot's time at a time of this machine's monotonic clock."""
        if self._estop.full or any(received.message.data for received in self._estop.poll()):
            self._press.put(Bool(True), 0.0)
        for way in self._ways:
            way.relay(now)


class _Way:
    """One topic of commands."""

    def __init__(self, bus: Bus, node: RosNode, topic: Topic[Twist], commanders: Commanders, *, let_go: bool) -> None:
        stamped = replace(topic, kind=TwistStamped, max_bytes=LARGEST_STAMPED)
        self._key = topic.key
        self._commanders = commanders
        self._let_go = let_go
        self._plain: Reader[Twist] = node.reader(topic, DEPTH)
        self._stamped: Reader[TwistStamped] = node.reader(stamped, DEPTH)
        self._boundary = node.boundary
        self._epoch = 0
        self._publisher: Publisher[Twist] = bus.publisher(topic, attach=self._attach)

    def relay(self, now: Callable[[float], float | None]) -> None:
        for plain in self._plain.poll():
            self._pass(plain, plain.message, 0.0, now)
        for stamped in self._stamped.poll():
            self._pass(stamped, stamped.message.twist, stamped.message.stamp_s, now)
