"""The services of a robot in a ROS graph, each a std_srvs/Trigger: its emergency stop, and a twin's fresh start."""

import contextlib
import threading
from collections.abc import Callable

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import EstopState, look_at_estop, press_estop, release_estop
from lira.hal.bus.topics import ESTOP_LOOK, ESTOP_PRESS, ESTOP_RELEASE, RESET
from lira.hal.errors import BusError
from lira.hal.messages import Episode
from lira.hal.rmw.services import Answer
from lira.hal.ros_graph.node import RosNode

LOOK_S = 0.02
RESET_S = 5.0


class Services:
    """Answers them on a thread of its own: the robot may take its time, and commands do not wait for it."""

    def __init__(self, bus: Bus, node: RosNode, *, arena: bool) -> None:
        asked: dict[str, Callable[[], str]] = {
            ESTOP_PRESS: lambda: _told(press_estop(bus)),
            ESTOP_RELEASE: lambda: _told(release_estop(bus)),
            ESTOP_LOOK: lambda: _told(look_at_estop(bus)),
        }
        if arena:
            asked[RESET] = lambda: bus.ask(RESET, msgspec.json.encode(Episode()), timeout_s=RESET_S).decode()
        self._services = [node.service(key, _answering(ask)) for key, ask in asked.items()]

    def run(self, stop: threading.Event) -> None:
        """Answer until `stop` is set, or the session is closed."""
        with contextlib.suppress(BusError):
            while not stop.wait(LOOK_S):
                for service in self._services:
                    service.serve()


def _answering(ask: Callable[[], str]) -> Callable[[], Answer]:
    def answer() -> Answer:
        try:
            return Answer(True, ask())
        except BusError as error:
            return Answer(False, str(error))

    return answer


def _told(state: EstopState) -> str:
    refused = ", ".join(f"{reason} {count}" for reason, count in state.refused.items() if count)
    return f"{state.state}{f' (commands refused: {refused})' if refused else ''}"
