"""A recording as a robot: its sensors measure again what they measured, and it obeys without moving."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from lira.hal.bus.sensors import SENSORS, Stamped, observation_of
from lira.hal.bus.topics import SIM_STATE
from lira.hal.errors import CodecError, DeviceError
from lira.hal.messages import Applied, Command, CourseState, Episode, Observation, Reason
from lira.hal.profile import RobotProfile
from lira.tools.recording.reader import Recorded, Recording

_NAMES = {sensor.topic.key: sensor.name for sensor in SENSORS}


class RecordedRobot:
    """Implements `hal.port.Robot`, and of `hal.port.Arena` what a recording can.

    Where the robot goes was decided when it was recorded: a command is taken and answered, and changes nothing. Its
    clock is that of the recording. Without a `clock` time passes only in `wait`; with one (such as `time.monotonic`) it
    passes by itself, `speed` times as fast. After the end nothing new comes, so everything is stale; `ended` says so.
    A reset begins the recording again; its clock goes on.
    """

    def __init__(
        self,
        recording: Recording,
        clock: Callable[[], float] | None = None,
        sleep: Callable[[float], None] = time.sleep,
        *,
        speed: float = 1.0,
    ) -> None:
        self._recording, self._clock, self._sleep, self._speed = recording, clock, sleep, speed
        self._began_s = recording.head.began_s
        self._time_s = self._began_s
        self._started_s = 0.0 if clock is None else clock()
        self._seq = 0
        self._newest: Observation | None = None
        self._begin(0.0)

    @property
    def profile(self) -> RobotProfile:
        """That of the robot that was recorded."""
        return self._recording.head.info.profile

    @property
    def arena_info(self) -> bytes:
        """What a twin said about its world, null for a floor."""
        return bytes(self._recording.head.info.arena)

    @property
    def ended(self) -> bool:
        """Whether nothing more comes."""
        return self._next is None

    def open(self) -> None:
        """Nothing to bring up."""

    def now(self) -> float:
        """Seconds on its clock."""
        if self._clock is None:
            return self._time_s
        return self._began_s + self._speed * (self._clock() - self._started_s)

    def wait(self, until_s: float) -> None:
        """Let time pass."""
        if self._clock is None:
            self._time_s = max(self._time_s, until_s)
        else:
            self._sleep(max(0.0, until_s - self.now()) / self._speed)

    def read(self) -> Observation:
        """Return the newest of every sensor that was recorded by now and is still fresh."""
        now_s = self.now()
        self._advance(now_s)
        if self._newest is None or self._newest.stamp_s != now_s:
            self._seq += 1
            self._newest = observation_of(self._seq, now_s, self._values)
        return self._newest

    def drive(self, command: Command) -> Applied:
        """Say that it does as told."""
        now_s = self.now()
        age_s = now_s - command.stamp_s
        return Applied(command.twist, now_s, command.source, Reason.OK, (), command.answers, age_s)

    def close(self) -> None:
        """Nothing to let go of."""

    def reset(self, episode: Episode) -> None:  # noqa: ARG002 - there is but one
        """Begin the recording again."""
        self._begin(self.now() - self._began_s)

    def state(self) -> CourseState:
        """Where the robot truly was. Raises `DeviceError` where nobody knew."""
        self._advance(self.now())
        if self._state is None:
            raise DeviceError("nobody recorded where the robot truly was", "Only a twin knows.")
        return self._state

    def _begin(self, shift_s: float) -> None:
        """Begin, with all times later by so much."""
        self._shift_s = shift_s
        self._messages: Iterator[Recorded] = self._recording.messages(*_NAMES, SIM_STATE)
        self._values: dict[str, Stamped | None] = {}
        self._state: CourseState | None = None
        self._newest = None
        self._next = next(self._messages, None)

    def _advance(self, now_s: float) -> None:
        while self._next is not None and self._next.sent_s + self._shift_s <= now_s:
            each, self._next = self._next, next(self._messages, None)
            try:
                message: Any = each.message
            except CodecError:
                continue
            if self._shift_s:
                message = replace(message, stamp_s=message.stamp_s + self._shift_s)
            if isinstance(message, CourseState):
                self._state = message
            else:
                self._values[_NAMES[each.key]] = message
