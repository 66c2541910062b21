"""The hand on the page: a bridge of its own, as a gamepad has one, in a thread of its own."""

import threading
from collections.abc import Callable

from lira.tools.joystick.bridge import Bridge
from lira.tools.joystick.client import TeleopClient
from lira.tools.joystick.known_pads import PadMemory
from lira.tools.web.pad import PageFinder
from lira.tools.web.seat import Seat, page_mapping

JOIN_S = 2.0
ADVICE = "nobody has the controls: press Drive on the page"


class Controls:
    """Drives one robot from whatever page has the seat, until closed: then the robot stands."""

    def __init__(self, client: TeleopClient, seat: Seat, say: Callable[[str], None] = print) -> None:
        self._client = client
        self._finder = PageFinder(seat, page_mapping())
        self._bridge = Bridge(client, self._finder, PadMemory(None), say, lambda: ADVICE)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._bridge.run, args=(self._stop,), name="controls", daemon=True)
        self._thread.start()

    def state(self) -> str:
        """How the dead-man is."""
        return self._bridge.hand

    def wake(self) -> None:
        """A page has spoken, or has gone."""
        self._finder.wake()

    def press_stop(self) -> None:
        """Press the emergency stop, whoever asks for it."""
        self._client.estop(pressed=True)

    @property
    def confirmed(self) -> bool:
        """Whether the robot has said that the stop holds which was pressed here."""
        return self._client.confirmed

    def close(self) -> None:
        """Let go."""
        self._stop.set()
        self._finder.wake()
        self._thread.join(JOIN_S)
