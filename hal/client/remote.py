"""A robot, and its arena, at the other end of the bus."""

import threading
from abc import abstractmethod

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import Info, reset_time
from lira.hal.bus.topics import RESET
from lira.hal.client.sensor_reader import SensorReader
from lira.hal.errors import BusError
from lira.hal.messages import CourseState, Episode
from lira.hal.port import Robot
from lira.hal.profile import RobotProfile

RESET_S = 20.0  # a new layout may have to be built


class RemoteRobot(Robot):
    """Implements `hal.port.Robot` over a bus, which stays the caller's; `open_remote` finds one.

    It is open as soon as it is made, and until `close`. `info` is what the robot said about itself.
    """

    def __init__(self, bus: Bus, info: Info) -> None:
        self.bus = bus
        self.info = info
        self._sensors = SensorReader(bus, info.profile)
        self._closed = threading.Event()

    @property
    def profile(self) -> RobotProfile:
        """The robot's profile, as it sent it."""
        return self.info.profile

    @property
    def arena(self) -> "RemoteArena | None":
        """What a twin can do and a floor cannot; None for a robot on a floor."""
        return RemoteArena(self) if self.info.has_arena else None

    def open(self) -> None:
        """Nothing to do: it is open from the start."""

    @abstractmethod
    def stand(self) -> None:
        """Have the robot stand until the next decision: what was decided before a reset does not drive after it."""

    @abstractmethod
    def refresh(self, reset_s: float) -> None:
        """Forget what was captured before a reset, and take up what comes after it."""

    @abstractmethod
    def state(self) -> CourseState | None:
        """Ground truth, None from a robot that does not tell."""

    def _check_open(self) -> None:
        if self._closed.is_set():
            raise BusError("the remote robot is closed", "Connect to it anew.")


class RemoteArena:
    """Implements `hal.port.Arena` for the twin behind a remote robot."""

    def __init__(self, robot: RemoteRobot) -> None:
        self._robot = robot

    @property
    def info(self) -> bytes:
        """What the twin says about its world, as JSON."""
        return bytes(self._robot.info.arena)

    def reset(self, episode: Episode) -> None:
        """Start afresh, and stand there until the next decision. Raises `BusError` if the twin refuses or is none."""
        self._robot.stand()
        answer = self._robot.bus.ask(RESET, msgspec.json.encode(episode), timeout_s=RESET_S)
        self._robot.refresh(reset_time(answer))

    def state(self) -> CourseState:
        """Ground truth now. Raises `BusError` if none comes."""
        state = self._robot.state()
        if state is None:
            raise BusError("the robot does not say where it really is", "Ground truth comes from a twin only.")
        return state
