"""Offers a robot of ours to a graph of ROS 2 over rmw_zenoh: a peer of the robot on one side, a node on the other.

It is a process of its own, so that nothing in it costs the robot's control anything. To the robot it is a peer like any
other: what ROS commands is judged by the governor there, under the lease, and ends when this process does.
"""

import itertools
import secrets
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import LOCKSTEP, ask_info
from lira.hal.bus.topics import APPLIED
from lira.hal.client.connect import on_bus
from lira.hal.clock import ClockEstimate
from lira.hal.errors import ConfigError
from lira.hal.messages import Reason
from lira.hal.ros_graph.node import RosNode
from lira.tools.ros2.commands import Commands
from lira.tools.ros2.graph import Graph
from lira.tools.ros2.services import Services
from lira.tools.ros2.telemetry import Telemetry, said_by

RELAY_S = 0.005
TELEMETRY_TURNS, LOOK_TURNS = 2, 100  # how many turns what is heard may wait, and whoever begins to listen
LOST_S = 1.0  # a robot that was not heard for so long may have another clock
JOIN_S = 3.0  # a service may be waiting for the robot
FIND_S = 60.0  # a robot opens its devices first


class Offer:
    """One robot in one graph."""

    def __init__(self, bus: Bus, node: RosNode) -> None:
        info = ask_info(bus, FIND_S)
        if info.mode == LOCKSTEP:
            raise ConfigError("a robot in lockstep is no robot of ROS's", "Run it in real time.")
        self._applied = bus.reader(APPLIED, 8)
        self._clock = ClockEstimate()
        self._heard_s = float("-inf")
        self._armed = False
        self._telemetry = Telemetry(bus, node, said_by(info.profile, arena=info.has_arena))
        self._commands = Commands(bus, node, info.profile.control, secrets.token_bytes(16), self._robot_time)
        self._services = Services(bus, node, arena=info.has_arena)

    def run(self, stop: threading.Event) -> None:
        """Relay until `stop` is set. Raises `BusError` when one of the sessions is closed."""
        services = threading.Thread(target=self._services.run, args=(stop,), name="services", daemon=True)
        services.start()
        for turn in itertools.count():
            if stop.wait(RELAY_S):
                services.join(JOIN_S)
                return
            self._listen()
            self._commands.relay()
            if turn % TELEMETRY_TURNS == 0:
                self._telemetry.relay()
            if turn % LOOK_TURNS == 0:
                self._telemetry.look()
                self._commands.advise(time.monotonic(), armed=self._armed)

    def _listen(self) -> None:
        for received in self._applied.poll():
            if (sent := received.attachment) is not None and self._clock.hear(
                sent.epoch, sent.time_s, received.arrived_s
            ):
                self._heard_s = received.arrived_s
                self._armed = received.message.reason is not Reason.NEUTRAL_FIRST

    def _robot_time(self, local_s: float) -> float | None:
        return self._clock.now(local_s) if local_s - self._heard_s < LOST_S else None


def offer(robot: str, address: str, graph: Graph, stop: threading.Event, ready: Callable[[], None]) -> None:
    """Offer the robot at `address` in a graph until `stop` is set; `ready` is called once it is there.

    Raises `BusError` where no robot answers or the port is taken, and `ConfigError` for names that cannot be.
    """
    with ExitStack() as held:
        node = RosNode(
            robot,
            connect=None if graph.own else graph.router,
            listen=graph.router if graph.own else None,
            domain=graph.domain,
            namespace=graph.namespace,
            insecure=True,  # what is not on this machine was asked for (`graph_of`)
        )
        held.callback(node.close)
        offered = Offer(held.enter_context(on_bus(address, robot)), node)
        ready()
        offered.run(stop)
