"""A robot, and its arena, at the other end of the bus."""

from collections.abc import Iterator
from contextlib import contextmanager

import msgspec

from lira.hal.bus.bus import CLOSE_S, Bus
from lira.hal.bus.endpoint import DEFAULT_ENDPOINT, DEFAULT_ROBOT
from lira.hal.bus.services import LOCKSTEP, Info, info_from_json, reset_time
from lira.hal.bus.topics import INFO, RESET
from lira.hal.client.lockstep import LockstepLink
from lira.hal.client.realtime import RealTimeLink
from lira.hal.errors import BusError
from lira.hal.messages import Applied, Command, CourseState, Episode, Observation
from lira.hal.profile import RobotProfile

INFO_S = 5.0
AGAIN_S = 0.5  # to ask a robot that was just heard
RESET_S = 20.0  # a new layout may have to be built


class RemoteRobot:
    """Implements `hal.port.Robot` over the bus, in real time or in lockstep as the robot has it.

    `answer_s` is how long `open` looks for the robot. The bus stays the caller's.
    """

    def __init__(self, bus: Bus, answer_s: float = INFO_S) -> None:
        self._bus = bus
        self._answer_s = answer_s
        self._info: Info | None = None
        self._link: LockstepLink | RealTimeLink | None = None
        self._epoch = 0

    @property
    def bus(self) -> Bus:
        """The bus it is on."""
        return self._bus

    @property
    def info(self) -> Info:
        """What the robot said about itself. Raises `BusError` before `open`."""
        if self._info is None:
            raise BusError("the remote robot is not open", "Call open() first.")
        return self._info

    @property
    def link(self) -> LockstepLink | RealTimeLink:
        """How it is driven. Raises `BusError` before `open` and after `close`."""
        if self._link is None:
            raise BusError("the remote robot is not open", "Call open() first.")
        return self._link

    @property
    def profile(self) -> RobotProfile:
        """The robot's profile, as it sent it. Raises `BusError` before `open`."""
        return self.info.profile

    @property
    def arena(self) -> "RemoteArena | None":
        """What a twin can do and a floor cannot; None for a robot on a floor. Raises `BusError` before `open`."""
        return None if bytes(self.info.arena) == b"null" else RemoteArena(self)

    def open(self) -> None:
        """Find the robot. Raises `BusError` if nobody answers."""
        info = info_from_json(self._bus.ask(INFO, timeout_s=self._answer_s))
        link = (LockstepLink if info.mode == LOCKSTEP else RealTimeLink)(self._bus, info.profile)
        # Asked once more: the robot shows its observation before it answers, and by now the link listens.
        self._info = info_from_json(self._bus.ask(INFO, timeout_s=self._answer_s))
        self._link = link
        link.start()
        self._epoch = link.epoch

    def started_anew(self) -> bool:
        """Whether the robot was started anew since this was asked last: times from before mean nothing then.

        Raises `BusError` if it came back as another one.
        """
        epoch = self.link.epoch
        if epoch == self._epoch:
            return False
        try:
            info = info_from_json(self._bus.ask(INFO, timeout_s=AGAIN_S))
        except BusError:
            return False  # gone again: asked once more the next time
        if (info.profile, info.mode) != (self.profile, self.info.mode):
            what = f"a robot '{info.profile.name}' ({info.mode}) came back in place of '{self.profile.name}'"
            raise BusError(what, "Start this program anew for it.")
        self._info, self._epoch = info, epoch
        return True

    def read(self) -> Observation:
        """Return the newest of every sensor that is fresh by the topic table."""
        return self.link.read()

    def drive(self, command: Command) -> Applied:
        """Send a command.

        In lockstep policy's command returns what was applied in its step, and teleop's at once. In real time either
        waits a moment for what was applied on it, and returns what was applied last if that does not come.
        """
        return self.link.drive(command)

    def now(self) -> float:
        """Seconds on the robot's clock: the step's in lockstep, an estimate that lags a little in real time."""
        return self.link.now()

    def wait(self, until_s: float) -> None:
        """Let the robot's time pass; in lockstep by one step at most."""
        self.link.wait(until_s)

    def close(self) -> None:
        """Say stop and fall silent; the robot runs on. May be called twice."""
        if self._link is not None:
            self._link.close()
            self._link = None


@contextmanager
def connect(
    address: str = DEFAULT_ENDPOINT, name: str = DEFAULT_ROBOT, *, close_s: float = CLOSE_S
) -> Iterator[RemoteRobot]:
    """Open the robot `name` that listens at `address` (HOST:PORT); in the end say stop, and leave it running.

    Leaving a link that is dead takes `close_s` at most. Raises `BusError` if nobody answers. Keys are those that
    LIRA_KEYS names.
    """
    bus = Bus(name, connect=address)
    robot = RemoteRobot(bus)
    try:
        robot.open()
        yield robot
    finally:
        robot.close()
        bus.close(close_s)


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
        self._robot.link.stand()
        answer = self._robot.bus.ask(RESET, msgspec.json.encode(episode), timeout_s=RESET_S)
        self._robot.link.refresh(reset_time(answer))

    def state(self) -> CourseState:
        """Ground truth now. Raises `BusError` if none comes."""
        state = self._robot.link.state()
        if state is None:
            raise BusError("the robot does not say where it really is", "Ground truth comes from a twin only.")
        return state
