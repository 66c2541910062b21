"""One robot under the script: its commands go out at 20 Hz, and all that it says is kept with the time it was heard."""

import time
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import Reader
from lira.hal.bus.sensors import Stamped
from lira.hal.bus.services import LOCKSTEP, ask_info
from lira.hal.bus.topics import APPLIED, CAMERA, CMD_VEL, IMU, ODOM, SCAN
from lira.hal.clock import ClockEstimate
from lira.hal.errors import BusError, ConfigError
from lira.hal.messages import STOP, Applied, CompressedImage, Imu, LaserScan, Odometry, Reason, Source, session_of
from lira.hal.profile import RobotProfile
from lira.tools.parity.script import Leg, motions

S = TypeVar("S", bound=Stamped)

SEND_S = 0.05
POLL_S = 0.002
DEPTH = 64
HEAR_S = 5.0
ARM_S = 3.0
FAREWELL = 3


class InterruptedScriptError(BusError):
    """The robot stopped in the middle: it saw something in its way, or too few commands came through."""


@dataclass(frozen=True, slots=True)
class Heard(Generic[S]):
    """A message, and when it came, on the robot's clock."""

    message: S
    at_s: float


@dataclass(frozen=True, slots=True)
class Span:
    """A phase as it was driven: from its first command to the next phase's, on the robot's clock."""

    phase: Leg
    began_s: float
    ended_s: float


@dataclass(slots=True)
class Recording:
    """All that one robot said during the script."""

    name: str
    profile: RobotProfile
    spans: list[Span] = field(default_factory=list)
    scan: list[Heard[LaserScan]] = field(default_factory=list)
    image: list[Heard[CompressedImage]] = field(default_factory=list)
    odom: list[Heard[Odometry]] = field(default_factory=list)
    imu: list[Heard[Imu]] = field(default_factory=list)
    applied: list[Heard[Applied]] = field(default_factory=list)

    def span(self, name: str) -> Span:
        """Return the phase of that name."""
        return next(span for span in self.spans if span.phase.name == name)


def record(bus: Bus, name: str) -> Recording:
    """Drive the robot on the bus through the script.

    Raises `BusError` if it is not there or does not arm, `InterruptedScriptError` if it stops in between, `ConfigError`
    if it does not run in real time.
    """
    info = ask_info(bus)
    if info.mode == LOCKSTEP:
        raise ConfigError(f"'{name}' runs in lockstep", "Start its twin without --lockstep: its time has to pass.")
    driver = _Driver(bus, Recording(name, info.profile))
    try:
        driver.meet()
        for phase in motions(info.profile.base):
            driver.drive(phase)
    finally:
        driver.leave()
    return driver.recording


class _Driver:
    def __init__(self, bus: Bus, recording: Recording) -> None:
        self.recording = recording
        self._session = session_of(bus.epoch)
        self._commands = bus.publisher(CMD_VEL)
        self._clock = ClockEstimate()
        self._readers: list[tuple[Reader[Any], list[Any]]] = [
            (bus.reader(topic, DEPTH), kept)
            for topic, kept in (
                *((APPLIED, recording.applied), (ODOM, recording.odom), (IMU, recording.imu)),
                *((SCAN, recording.scan), (CAMERA, recording.image)),
            )
        ]

    def now(self) -> float:
        return self._clock.now(time.monotonic())

    def meet(self) -> None:
        """Learn the robot's clock, arm it, and forget what was heard so far."""
        self._until(lambda: self._clock.known, HEAR_S, "says nothing about its wheels")
        self._until(self._arms, ARM_S, "does not take a command; is it driven by somebody else, or held?")
        for _, kept in self._readers:
            kept.clear()

    def drive(self, phase: Leg) -> None:
        began_s = self.now()
        end_s, send_s = began_s + phase.duration_s, began_s
        while (now_s := self.now()) < end_s:
            if now_s >= send_s:
                send_s = max(send_s + SEND_S, now_s + SEND_S / 2)
                self._commands.put(phase.twist, now_s)
            self._listen()
            time.sleep(POLL_S)
        self.recording.spans.append(Span(phase, began_s, end_s))
        self._check(phase)

    def leave(self) -> None:
        """Stop, and say so."""
        if self._clock.known:
            for _ in range(FAREWELL):
                self._commands.put(STOP, self.now(), released=True)

    def _arms(self) -> bool:
        self._commands.put(STOP, self.now())
        return self._obeys()

    def _obeys(self) -> bool:
        """Whether the robot said last that it drives on these commands."""
        if not self.recording.applied:
            return False
        newest = self.recording.applied[-1].message
        return newest.reason is Reason.OK and (newest.source, newest.session) == (Source.POLICY, self._session)

    def _check(self, phase: Leg) -> None:
        """Raise if the robot did something else in the end."""
        if not self._obeys():
            applied = self.recording.applied[-1].message if self.recording.applied else None
            why = "nothing" if applied is None else ", ".join([applied.reason.value, *applied.clamps])
            raise InterruptedScriptError(
                f"'{self.recording.name}' did not do '{phase.name}' to the end; it says: {why}",
                "It needs a metre of free floor on all sides, its sensors, no other driver, and a machine with time.",
            )

    def _until(self, done: Any, timeout_s: float, complaint: str) -> None:
        deadline_s = time.monotonic() + timeout_s
        while True:
            self._listen()
            if done():
                return
            if time.monotonic() > deadline_s:
                raise BusError(f"'{self.recording.name}' {complaint}", "Check that it is still running.")
            time.sleep(SEND_S)

    def _listen(self) -> None:
        for reader, kept in self._readers:
            for received in reader.poll():
                if kept is self.recording.applied and received.attachment is not None:
                    self._clock.note(received.attachment.time_s, received.arrived_s)
                if self._clock.known:
                    kept.append(Heard(received.message, self._clock.now(received.arrived_s)))
