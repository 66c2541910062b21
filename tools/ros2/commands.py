"""What a ROS graph commands, passed on to the robot: velocities with and without a stamp, and the emergency stop."""

import re
import sys
from dataclasses import replace
from functools import partial
from typing import Protocol

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.reader import Received
from lira.hal.bus.topics import CMD_VEL, ESTOP, TELEOP, Topic
from lira.hal.messages import Bool, Twist, TwistStamped, is_neutral
from lira.hal.profile import Control
from lira.hal.rmw.attachment import parse_rmw_attachment
from lira.hal.ros_graph.node import RosNode
from lira.hal.server.command_watch import CommandWatch, Noted
from lira.tools.ros2.commanders import Commanders

DEPTH = 32
NO_ROBOT = "the robot is not heard"


class RobotTime(Protocol):
    """The robot's clock at a time of this machine's monotonic one; None while the robot is not heard."""

    def __call__(self, local_s: float) -> float | None:
        """Return it."""


class Commands:
    """Relays commands. Each publisher in the graph stays a commander of its own, with the age that its commands have.

    A hand's zero means that it lets go, as on the bus from whoever cannot say so in another way.
    """

    def __init__(self, bus: Bus, node: RosNode, control: Control, salt: bytes, robot_time: RobotTime) -> None:
        commanders = Commanders(salt)
        timeouts = (CMD_VEL, control.policy_timeout_s), (TELEOP, control.teleop_timeout_s)
        self._watch = CommandWatch()
        self._advised: set[str] = set()
        self._ways = [
            _Way(bus, node, topic, commanders, robot_time, partial(self._watch.note_ros, timeout_s=timeout_s))
            for topic, timeout_s in timeouts
        ]
        self._estop = node.reader(ESTOP, DEPTH)
        self._press: Publisher[Bool] = bus.publisher(ESTOP)

    def relay(self) -> None:
        """Pass on what came."""
        pressed = any(received.message.data for received in self._estop.poll())
        if pressed or self._estop.full:  # one that was lost may have been a press
            self._press.put(Bool(True), 0.0)
        for way in self._ways:
            way.relay()

    def advise(self, now_s: float, *, armed: bool) -> None:
        """Say, once each, why what is commanded does not drive: ROS has no word for it. `now_s` is monotonic."""
        for advice in self._watch.advice(now_s, armed=armed):
            kind = re.sub(r"[0-9.]+", "", advice)  # whatever the numbers in it are by now
            if kind not in self._advised:
                print(advice, file=sys.stderr, flush=True)
            self._advised.add(kind)


class Note(Protocol):
    """What is told of each command that came, for advice."""

    def __call__(self, key: str, sender: str, *, noted: Noted) -> None:
        """Note it."""


class _Way:
    """One topic of commands."""

    def __init__(
        self,
        bus: Bus,
        node: RosNode,
        topic: Topic[Twist],
        commanders: Commanders,
        robot_time: RobotTime,
        note: Note,
    ) -> None:
        self._key = topic.key
        self._hand = topic is TELEOP
        self._commanders = commanders
        self._robot_time = robot_time
        self._boundary = node.boundary
        self._note = note
        # Each type has a key of its own in such a graph.
        plain: Topic[Twist] = replace(topic, stamped=None)
        stamped: Topic[TwistStamped] = Topic(
            topic.key, TwistStamped, topic.rate_hz, topic.max_age_s, topic.qos, topic.max_bytes
        )
        self._plain, self._stamped = node.reader(plain, DEPTH), node.reader(stamped, DEPTH)
        self._epoch = 0  # in whose name the next is sent
        self._publisher: Publisher[Twist] = bus.publisher(topic, attach=self._attach)

    def relay(self) -> None:
        for plain in self._plain.poll():
            self._pass(plain, plain.message, 0.0)
        for stamped in self._stamped.poll():
            self._pass(stamped, stamped.message.twist, stamped.message.stamp_s)

    def _pass(self, received: Received[Twist] | Received[TwistStamped], twist: Twist, stamp_s: float) -> None:
        with self._boundary.guard(self._key):
            now_s = self._robot_time(received.arrived_s)
            order = self._commanders.judge(parse_rmw_attachment(received.attached), stamp_s, received.arrived_s)
            if isinstance(order, str) or now_s is None:
                self._refuse(order if isinstance(order, str) else NO_ROBOT)
                return
            age_s = order.age_s if stamp_s else None
            self._note(self._key, f"{order.epoch}", noted=Noted(received.arrived_s, age_s, not is_neutral(twist)))
            self._epoch = order.epoch
            released = self._hand and is_neutral(twist)
            self._publisher.put(twist, now_s - order.age_s, seq=order.seq, released=released)

    def _refuse(self, reason: str) -> None:
        if (self._key, reason) not in self._boundary.counts:
            print(f"a command on '{self._key}' is not passed on: {reason}", file=sys.stderr, flush=True)
        self._boundary.refuse(self._key, reason)

    def _attach(self, time_s: float, seq: int | None, answers: int, *, released: bool) -> bytes:
        return Attachment(self._epoch, seq or 0, round(time_s * 1e9), answers, released).to_bytes()
