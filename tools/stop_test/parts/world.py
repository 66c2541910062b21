"""The world of a robot with real drivers: a twin behind its devices, which notes what the base gave the wheels.

It goes on whatever happens to the robot's process. Control messages: `reset` puts the robot back to its start; `well`
mends all; the others are the names in `Devices.break_`.

python -m lira.tools.stop_test.parts.world PROFILE JOURNAL CONTROL_PORT FOLDER
"""

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from lira.hal.messages import Command, Episode, Twist
from lira.hal.profile import load_profile
from lira.hal.signals import stop_on_signal
from lira.hal.testing import small_pictures
from lira.robot.core2.rosserial import ASK_TOPICS
from lira.sim_backend.emulators.wired_twin import WiredTwin
from lira.sim_backend.polyline import Floats
from lira.tools.stop_test.control import listen
from lira.tools.stop_test.journal import JournalWriter
from lira.tools.stop_test.parts.robot import NotedTwin, keep_truth

READY = "devices, camera at "
NEAR_M = 0.15  # in front of the lidar: inside the protective field
BOARD_RESETS = "board resets "


class Gate:
    """Stands between a device and its line: what is shut off does not get through. `deaf`: it hears nothing; `mute`:
    nobody hears it. `mute_until_asked`: nor does anybody until the host asks which topics it has. `soon` takes what is
    to be done to the device on its own thread.
    """

    def __init__(self, unit: Any) -> None:
        self.deaf = self.mute = self.mute_until_asked = False
        self.soon: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._receive: Callable[[bytes, float], None] = unit.receive
        self._emit: Callable[[float], bytes] = unit.emit
        unit.receive, unit.emit = self.receive, self.emit

    def open(self) -> None:
        """Let everything through."""
        self.deaf = self.mute = self.mute_until_asked = False

    def receive(self, data: bytes, now_s: float) -> None:
        """Take what the host sent."""
        if ASK_TOPICS in data:
            self.mute_until_asked = False
        if not self.deaf:
            self._receive(data, now_s)

    def emit(self, now_s: float) -> bytes:
        """Return what the host gets."""
        while not self.soon.empty():
            self.soon.get()()
        data = self._emit(now_s)
        return b"" if self.mute or self.mute_until_asked else data


class Devices(WiredTwin):
    """A twin behind wires, whose devices break by a control message."""

    obstacle = False

    def __init__(self, twin: NotedTwin, folder: Path) -> None:
        super().__init__(twin, folder)
        self.board, self.laser = Gate(self.base), Gate(self.lidar)

    def hear(self, message: str) -> None:
        """Obey a control message."""
        if message == "reset":
            self.reset(Episode())
        elif message == "well":
            self.mend()
        elif message.startswith(BOARD_RESETS):
            self.reset_board(float(message.removeprefix(BOARD_RESETS)))
        else:
            self.break_(message)

    def break_(self, message: str) -> None:
        """Break one thing."""
        match message:
            case "board deaf":
                self.board.deaf = True
            case "board mute":
                self.board.mute = True
            case "board mute until asked":
                self.board.mute_until_asked = True
            case "lidar mute":
                self.laser.mute = True
            case "lidar unplugged":
                self.lidar_wire.unplug()
            case "obstacle":
                self.obstacle = True

    def mend(self) -> None:
        """Mend everything."""
        self.obstacle = False
        self.board.open()
        self.laser.open()
        self.lidar_wire.plug()

    def reset_board(self, boot_s: float) -> None:
        """Press the board's reset button; it is up again after `boot_s`."""
        self.board.soon.put(lambda: self.base.reset(boot_s))

    def _drive(self, twist: Twist) -> None:
        """Note what the base gives the wheels as it is: wheels that swing would blur the mark of who commanded it."""
        self.twin.drive(Command(twist, self.twin.now()))

    def _distances(self, theta_rad: Floats) -> Floats:
        distances = super()._distances(theta_rad)
        return np.full_like(distances, NEAR_M) if self.obstacle else distances


def main(profile_name: str, journal_folder: str, control_port: int, folder: str) -> None:
    """Be the devices until told to stop."""
    twin = NotedTwin(small_pictures(load_profile(profile_name)), "corridor", realtime_factor=1.0, renderer="sketch")
    twin.journal = JournalWriter(Path(journal_folder), "world")
    devices = Devices(twin, Path(folder))
    try:
        listen(control_port, devices.hear)
        threading.Thread(target=keep_truth, args=(twin, twin.journal), daemon=True).start()
        with stop_on_signal() as stop:
            print(f"{READY}{devices.url}", flush=True)
            stop.wait()
    finally:
        devices.close()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4])
