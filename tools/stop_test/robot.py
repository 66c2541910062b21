"""The robot under test: a HAL server in real time on a twin that can be broken by word, and that keeps a journal.

python -m tools.stop_test.robot NAME HOST:PORT PROFILE JOURNAL EAR_PORT
"""

import signal
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from hal.bus import Bus
from hal.governed import GovernedRobot
from hal.messages import Applied, Command, Image, LaserScan, Observation
from hal.profile import RobotProfile, load_profile
from hal.server import HalServer, stop_on_signal
from sim_backend.twin import Twin
from tools.stop_test.control import Ear
from tools.stop_test.journal import Given, JournalWriter, Truth

READY = "serving"
TRUTH_S = 0.01
NAP_S = 0.01
MAIN_HANGS_S = 2.0
# What the pictures show does not matter here; small ones leave the processor to what is measured.
WIDTH_PX, HEIGHT_PX = 64, 48


class BreakableTwin(Twin):
    """A twin whose devices fail by word; the empty word mends them."""

    fault = ""
    _held: Observation | None = None

    def drive(self, command: Command) -> Applied:
        """Hang, if told so, as a driver on a dead serial line does."""
        while self.fault == "base hangs":
            time.sleep(NAP_S)
        return super().drive(command)

    def read(self) -> Observation:
        """Read, with the fault in it."""
        while self.fault == "camera hangs":
            time.sleep(NAP_S)
        seen = super().read()
        if not self.fault:
            self._held = seen
        held = self._held or seen
        if self.fault == "camera freezes":
            return replace(seen, image=held.image)
        if self.fault == "lidar freezes":
            return replace(seen, scan=held.scan)
        if self.fault == "half a scan" and isinstance(seen.scan, LaserScan):
            return replace(seen, scan=replace(seen.scan, ranges=seen.scan.ranges[: len(seen.scan.ranges) // 2]))
        if self.fault == "black image" and isinstance(seen.image, Image):
            return replace(seen, image=replace(seen.image, data=np.zeros_like(seen.image.data)))
        return seen


class WatchedRobot(GovernedRobot):
    """Notes down what the wheels are given."""

    def __init__(self, twin: Twin, journal: JournalWriter) -> None:
        super().__init__(twin)
        self._journal = journal

    def _actuate(self) -> Applied:
        applied = super()._actuate()
        twist = applied.twist
        self._journal.given(Given(time.monotonic(), twist.linear_m_s, twist.angular_rad_s, applied.command_age_s))
        return applied


def small_pictures(profile: RobotProfile) -> RobotProfile:
    """Return the profile with a small camera."""
    camera = msgspec.structs.replace(profile.camera, width_px=WIDTH_PX, height_px=HEIGHT_PX)
    return msgspec.structs.replace(profile, camera=camera)


def main(name: str, endpoint: str, profile_name: str, journal_path: str, ear_port: int) -> None:
    """Serve until told to stop."""
    twin = BreakableTwin(small_pictures(load_profile(profile_name)), "line", realtime_factor=1.0, renderer="tiny")
    journal = JournalWriter(Path(journal_path))

    def hear(word: str) -> None:
        if word == "main hangs":
            signal.raise_signal(signal.SIGUSR1)
        else:
            twin.fault = word

    # Signals are handled in the main thread.
    signal.signal(signal.SIGUSR1, lambda *_: time.sleep(MAIN_HANGS_S))
    Ear(ear_port, hear)
    bus = Bus(name, listen=endpoint)
    try:
        with stop_on_signal() as stop:

            def ready() -> None:
                threading.Thread(target=keep_truth, args=(twin, journal), daemon=True).start()
                print(READY, flush=True)

            HalServer(WatchedRobot(twin, journal), bus, twin, ready=ready).run(stop)
    finally:
        bus.close()


def keep_truth(twin: Twin, journal: JournalWriter) -> None:
    """Note where the robot really is, for as long as the process lives."""
    while True:
        state = twin.state()
        journal.truth(Truth(time.monotonic(), state.x_m, state.y_m, state.linear_m_s))
        time.sleep(TRUTH_S)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4], int(sys.argv[5]))
