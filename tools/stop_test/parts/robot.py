"""The robot under test: a HAL server in real time that keeps a journal, on a robot that can be broken by word.

That is a twin; or, with the folder of a world's devices, the physical robot's drivers; or, with the port of a bridge,
what `lira ros2` serves.

python -m lira.tools.stop_test.parts.robot NAME HOST:PORT PROFILE JOURNAL CONTROL_PORT [FOLDER CAMERA_URL | PORT]
"""

import signal
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from lira.hal.bus.bus import Bus
from lira.hal.bus.security.access_log import count_refusals
from lira.hal.messages import Applied, Command, Image, LaserScan, Observation
from lira.hal.messages.compression import compress
from lira.hal.port import Robot
from lira.hal.profile import RobotProfile, load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.signals import stop_on_signal
from lira.hal.testing import small_pictures
from lira.robot.ros2.robot import Interface, Ros2Robot
from lira.robot.rosbot import Devices, Rosbot
from lira.sim_backend.twin import Twin
from lira.tools.stop_test.control import ASK_TIME, listen, print_time
from lira.tools.stop_test.journal import Heard, JournalWriter, Said, Truth, Wheels, moves

READY = "serving"
TRUTH_S = 0.01
NAP_S = 0.01
MAIN_HANGS_S = 2.0


class NotedTwin(Twin):
    """A twin whose wheels are watched."""

    journal: JournalWriter

    def drive(self, command: Command) -> Applied:
        """Pass it on to the wheels."""
        began_s = time.monotonic()
        applied = super().drive(command)
        twist = command.twist
        noted_s = began_s if moves(twist.linear_m_s, twist.angular_rad_s) else time.monotonic()
        self.journal.note(Wheels(noted_s, twist.linear_m_s, twist.angular_rad_s))
        return applied


class BreakableTwin(NotedTwin):
    """A twin whose devices fail by a control message; the empty one mends them."""

    fault = ""
    _held: Observation | None = None

    def __init__(self, profile: RobotProfile, journal: JournalWriter) -> None:
        super().__init__(profile, "line", realtime_factor=1.0, renderer="sketch")
        self.journal = journal

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
        if self.fault == "black image" and seen.image is not None:
            camera = self.profile.camera
            black = Image(seen.image.stamp_s, np.zeros((camera.height_px, camera.width_px, 3), np.uint8))
            return replace(seen, image=compress(black, camera.encoding))
        return seen


class BreakableDrivers(Rosbot):
    """The physical robot, whose base driver hangs by a control message, with all of its threads."""

    @property
    def fault(self) -> str:
        """What is broken now."""
        return ""

    @fault.setter
    def fault(self, word: str) -> None:
        if word == "base hangs":
            self.base._lock.acquire()  # every thread of the driver needs it
        elif self.base._lock.locked():
            self.base._lock.release()


class BridgedRobot(Ros2Robot):
    """A robot that runs ROS 2. Nothing here breaks by a control message."""

    fault = ""


class WatchedRobot(GovernedRobot):
    """Notes what arrives and what the governor says. While it `hangs`, so does every thread that needs the governor."""

    hangs = False

    def __init__(self, robot: Robot, journal: JournalWriter) -> None:
        super().__init__(robot)
        self._journal = journal

    def submit(self, command: Command) -> None:
        """Pass it on to the governor."""
        self._journal.note(Heard(time.monotonic(), command.twist.linear_m_s, command.twist.angular_rad_s))
        super().submit(command)

    def _actuate(self) -> Applied:
        while self.hangs:
            time.sleep(NAP_S)
        applied = super()._actuate()
        moving = moves(applied.twist.linear_m_s, applied.twist.angular_rad_s)
        self._journal.note(Said(time.monotonic(), applied.reason, moving))
        return applied


def main(name: str, endpoint: str, profile_name: str, journal_folder: str, control_port: str, *devices: str) -> None:
    """Serve until told to stop."""
    profile, journal = small_pictures(load_profile(profile_name)), JournalWriter(Path(journal_folder), "robot")
    far = Bus(name, connect=f"127.0.0.1:{devices[0]}", prefix="") if len(devices) == 1 else None
    robot: BreakableTwin | BreakableDrivers | BridgedRobot
    if far is not None:
        robot = BridgedRobot(profile, far, Interface())
    else:
        robot = open_drivers(profile, *devices) if devices else BreakableTwin(profile, journal)
    watched = WatchedRobot(robot, journal)

    def hear(message: str) -> None:
        watched.hangs = message == "governor hangs"
        if message == "main hangs":
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR1)
        elif message == ASK_TIME:
            print_time()
        else:
            robot.fault = message

    signal.signal(signal.SIGUSR1, lambda *_: time.sleep(MAIN_HANGS_S))  # signals are handled in the main thread
    listen(int(control_port), hear)
    bus = Bus(name, listen=endpoint, refusals=count_refusals())
    try:
        with stop_on_signal() as stop:
            twin = robot if isinstance(robot, Twin) else None

            def ready() -> None:
                if twin is not None:
                    threading.Thread(target=keep_truth, args=(twin, journal), daemon=True).start()
                print(READY, flush=True)

            HalServer(watched, bus, twin, ready=ready).run(stop)
    finally:
        bus.close()
        if far is not None:
            far.close()


def open_drivers(profile: RobotProfile, folder: str, camera_url: str) -> BreakableDrivers:
    """Return the physical robot on the devices in a folder."""
    devices = Devices(base=f"{folder}/core2", lidar=f"{folder}/rplidar", camera=camera_url)
    return BreakableDrivers(profile, devices)


def keep_truth(twin: Twin, journal: JournalWriter) -> None:
    """Note where the robot really is, for as long as the process lives."""
    while True:
        state = twin.state()
        journal.note(Truth(time.monotonic(), state.x_m, state.y_m, state.linear_m_s))
        time.sleep(TRUTH_S)


if __name__ == "__main__":
    main(*sys.argv[1:])
