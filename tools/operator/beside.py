"""A screen or a pad beside the robot: the sessions it needs, until it is told to end."""

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import NamedTuple

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import LOCKSTEP, Info, ask_info
from lira.hal.client.connect import on_bus
from lira.tools.joystick.client import TeleopClient
from lira.tools.launch.lifetime import CLOSE_S, stop_or_interrupt

ANSWER_S = 10.0


class Beside(NamedTuple):
    """`bus` is for what is sent, `watch` hears everybody, `stop` is set by a signal."""

    bus: Bus
    watch: Bus
    info: Info
    stop: threading.Event

    def client(self, say: Callable[[str], None] = print) -> TeleopClient | None:
        """What drives by hand; None beside a robot in lockstep, which no hand follows."""
        return None if self.info.mode == LOCKSTEP else TeleopClient(self.bus, self.watch, ANSWER_S, say)


@contextlib.contextmanager
def beside(name: str, endpoint: str) -> Iterator[Beside]:
    """Open the sessions. Raises `BusError` if no robot answers."""
    with on_bus(endpoint, name, close_s=CLOSE_S) as bus, stop_or_interrupt() as stop:
        info = ask_info(bus, ANSWER_S)
        with on_bus(endpoint, name, watch=True, close_s=CLOSE_S) as watch:
            yield Beside(bus, watch, info, stop)
