"""The world of a robot with real drivers: a twin behind its devices, which notes what the base gave the wheels.

It goes on whatever happens to the robot's process. Words: `reset` puts the robot back to its start.

python -m tools.stop_test.world PROFILE JOURNAL EAR_PORT FOLDER
"""

import math
import sys
import threading
import time
from pathlib import Path

from hal.messages import STOP, Applied, Command, Episode
from hal.profile import load_profile
from hal.server import stop_on_signal
from sim_backend.emulators.bench import WiredTwin
from sim_backend.twin import Twin
from tools.stop_test.control import Ear
from tools.stop_test.journal import Given, JournalWriter
from tools.stop_test.robot import keep_truth, small_pictures

READY = "devices, camera at "


class NotedTwin(Twin):
    """Notes when the base gives the wheels zero; what it is given before, the robot notes."""

    journal: JournalWriter
    _moving = False

    def drive(self, command: Command) -> Applied:
        """Pass it on."""
        if self._moving and command.twist == STOP:
            self.journal.given(Given(time.monotonic(), 0.0, 0.0, math.nan))
        self._moving = command.twist != STOP
        return super().drive(command)


def main(profile_name: str, journal_path: str, ear_port: int, folder: str) -> None:
    """Be the devices until told to stop."""
    twin = NotedTwin(small_pictures(load_profile(profile_name)), "corridor", realtime_factor=1.0, renderer="tiny")
    twin.journal = JournalWriter(Path(journal_path))
    wired = WiredTwin(twin, Path(folder))
    try:
        Ear(ear_port, lambda _: wired.reset(Episode()))
        threading.Thread(target=keep_truth, args=(twin, twin.journal), daemon=True).start()
        with stop_on_signal() as stop:
            print(f"{READY}{wired.url}", flush=True)
            stop.wait()
    finally:
        wired.close()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4])
