"""An arena without its robot on the bus: the truth of a twin that is driven through its devices."""

import threading
from collections.abc import Callable

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import Info
from lira.hal.bus.topics import SIM_STATE
from lira.hal.port import Arena
from lira.hal.server.info_service import InfoService

POLL_S = 0.005


class ArenaLoop:
    """Publishes where the robot really is, and puts it down anew when asked. `now` is the arena's clock."""

    def __init__(self, arena: Arena, bus: Bus, info: Info, now: Callable[[], float]) -> None:
        self._arena = arena
        self._now = now
        self._boundary = bus.boundary
        self._info_service = InfoService(bus, info, arena, now)
        self._state = bus.publisher(SIM_STATE)
        bus.count_from_1970(now)

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop` is set."""
        due_s = self._now()
        while not stop.wait(POLL_S):
            self._info_service.serve(self._show)
            if self._now() >= due_s:
                due_s = self._now() + 1.0 / SIM_STATE.rate_hz
                self._show()

    def _show(self) -> None:
        with self._boundary.guard(SIM_STATE.key):
            self._state.put(self._arena.state(), self._now())
