"""The HAL server: puts one robot on the bus, in real time or in lockstep, and stops it before anything else."""

import sys
import threading
from collections.abc import Callable

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import LOCKSTEP, REALTIME, Info
from lira.hal.bus.topics import INFO
from lira.hal.errors import BusError
from lira.hal.messages import CameraInfo
from lira.hal.port import Arena
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.command_watch import CommandWatch
from lira.hal.server.diagnostics import Reporter
from lira.hal.server.estop_service import EstopService
from lira.hal.server.info_service import InfoService
from lira.hal.server.instance import only_instance
from lira.hal.server.lockstep import LockstepLoop
from lira.hal.server.realtime import JOIN_S, SWITCH_S, AppliedLoop, CommandLoop, PictureLoop, SensorLoop
from lira.hal.server.sensor_publisher import SensorPublisher

LOOK_S = 0.05
RIVAL_S = 0.5  # how long to listen for another robot of the same name


class HalServer:
    """Serves `robot` until told to stop. It opens and closes the robot; the bus stays the caller's.

    `arena` is the twin behind the robot, if there is one, and `arena_info` JSON about its world for whoever asks.
    `calibration` is its camera's, None for the profile's pinhole. `ready`, if given, is called once the robot answers;
    in real time `alive` over and over by the thread that moves the wheels, so it must not wait.
    """

    def __init__(
        self,
        robot: GovernedRobot,
        bus: Bus,
        arena: Arena | None = None,
        *,
        arena_info: bytes = b"null",
        lockstep: bool = False,
        calibration: CameraInfo | None = None,
        ready: Callable[[], None] = lambda: None,
        alive: Callable[[], None] = lambda: None,
    ) -> None:
        self._robot = robot
        self._bus = bus
        self._arena = arena
        self._info = Info(robot.profile, LOCKSTEP if lockstep else REALTIME, bus.epoch, msgspec.Raw(arena_info))
        self._calibration = calibration
        self._ready = ready
        self._alive = alive

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop` is set; sets it if a thread of the server fails, and raises what it failed with.

        Raises `BusError` if a robot of this name already runs.
        """
        with only_instance(self._bus.robot):
            self._look_for_rival()
            if self._info.mode == LOCKSTEP:
                self._run_lockstep(stop)
            else:
                self._run_realtime(stop)

    def _look_for_rival(self) -> None:
        if self._bus.peers() > 0 and self._bus.is_answered(INFO, RIVAL_S):
            raise BusError(
                f"a robot named '{self._bus.robot}' already answers at {self._bus.endpoint}",
                "Stop it, or give this one another name.",
            )

    def _info_service(self) -> InfoService:
        return InfoService(self._bus, self._info, self._arena, self._robot.now)

    def _run_lockstep(self, stop: threading.Event) -> None:
        self._robot.open()
        try:
            sensors = SensorPublisher(self._bus, self._robot.profile, self._calibration, lockstep=True)
            loop = LockstepLoop(self._robot, self._bus, sensors, self._info_service(), self._arena)
            sensors.describe(self._robot.now(), arena=self._arena is not None)
            self._ready()
            loop.run(stop)
        finally:
            self._robot.close()

    def _run_realtime(self, stop: threading.Event) -> None:
        sys.setswitchinterval(SWITCH_S)
        crew = _Crew(stop)
        opened, wheels_still = threading.Event(), threading.Event()
        publisher = SensorPublisher(self._bus, self._robot.profile, self._calibration, lockstep=False)
        pictures = PictureLoop(self._robot, publisher)

        def sense() -> None:
            # What opens the devices reads and closes them: some are bound to their thread.
            self._robot.open()
            try:
                self._bus.count_from_1970(self._robot.now)
                publisher.describe(self._robot.now(), arena=self._arena is not None)
                loop = SensorLoop(self._robot, self._bus, publisher, pictures, self._info_service(), self._arena)
                opened.set()
                loop.run(wheels_still)
            finally:
                self._robot.close()

        sensors = crew.start("sensors", sense)
        while not opened.wait(LOOK_S) and not stop.is_set():
            pass
        applied = AppliedLoop(self._robot, self._bus)
        watch = CommandWatch()
        commands = CommandLoop(self._robot, self._bus, applied, watch, self._alive)
        wheels = crew.start("commands", lambda: commands.run(stop))
        crew.start("applied", lambda: applied.run(stop))
        crew.start("pictures", lambda: pictures.run(stop))
        estop = EstopService(self._robot, self._bus)
        crew.start("estop", lambda: estop.run(stop))
        reporter = Reporter(self._robot, self._bus, watch)
        crew.start("diagnostics", lambda: reporter.run(stop))
        try:
            if opened.is_set():
                self._ready()
            # The main thread does nothing, so that it hears signals even while a sensor never answers.
            stop.wait()
        finally:
            stop.set()
            wheels.join(JOIN_S)
            wheels_still.set()
            sensors.join(JOIN_S)
        crew.raise_first_failure()


class _Crew:
    """Threads of which the first to fail stops all."""

    def __init__(self, stop: threading.Event) -> None:
        self._stop = stop
        self._failures: list[BaseException] = []

    def start(self, name: str, work: Callable[[], None]) -> threading.Thread:
        def run() -> None:
            try:
                work()
            except BaseException as error:  # noqa: BLE001 - raised again by the main thread
                self._failures.append(error)
                self._stop.set()

        thread = threading.Thread(target=run, name=f"hal-{name}", daemon=True)
        thread.start()
        return thread

    def raise_first_failure(self) -> None:
        if self._failures:
            raise self._failures[0]
