"""A client's side of lockstep: the step it is in, and how it goes on to the next.

Everything belongs to one observation until `wait` (or a reset) moves on, even if the next is already here: what a
step sees does not depend on how fast the messages came.
"""

import time

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import Info, ask_info
from lira.hal.bus.topics import APPLIED, CLOCK, CMD_VEL, IN_LOCKSTEP, SIM_STATE, TELEOP
from lira.hal.client.remote import RemoteRobot
from lira.hal.errors import BusError
from lira.hal.messages import STOP, Applied, Clock, Command, CourseState, Observation, Source

ANSWER_S = 5.0  # wall time; a robot that is silent for longer is gone
POLL_S = 0.0001
ROUNDING_S = 1e-6


class LockstepRobot(RemoteRobot):
    """A robot whose time waits for commands."""

    def __init__(self, bus: Bus, info: Info) -> None:
        super().__init__(bus, info)
        self._states = bus.reader(SIM_STATE)
        self._results = bus.reader(APPLIED)
        self._clock = bus.reader(CLOCK)
        self._policy = bus.publisher(CMD_VEL, IN_LOCKSTEP)
        self._teleop = bus.publisher(TELEOP, IN_LOCKSTEP)
        self._applied = Applied(STOP, 0.0)
        self._observation = Observation(-1, 0.0)
        self._state: CourseState | None = None
        self._answered = True
        ask_info(bus)  # the robot shows what it sees before it answers, and by now it is listened for
        self._advance()

    def stand(self) -> None:
        """Nothing to do: between two decisions no time passes."""

    def refresh(self, reset_s: float) -> None:  # noqa: ARG002 - in real time it is needed
        """Take up the first observation after a reset, whatever became of the last one."""
        self._take_newest()

    def _take_newest(self) -> None:
        if (newest := self._newer()) is not None:
            self._take(*newest)

    def now(self) -> float:
        """Time of the present step."""
        self._check_open()
        return self._observation.stamp_s

    def read(self) -> Observation:
        """Return the observation of the present step."""
        self._check_open()
        if not self._answered:
            self._take_newest()
        return self._observation

    def state(self) -> CourseState | None:
        """Ground truth of the present step, None from a robot that knows none."""
        self.read()
        return self._state

    def drive(self, command: Command) -> Applied:
        """Answer the present observation. Policy's command closes the step and returns what was applied in it;
        teleop's only goes before it and returns what was applied last.

        Raises `BusError` for a command that answers another observation, and for a robot that does not answer.
        """
        if self._answered and command.answers == -1:
            self._advance()
        seq = self.read().seq
        if self._answered or command.answers not in (-1, seq):
            raise BusError(
                f"a command answers observation {command.answers}, but it is no longer waited for",
                "In lockstep answer each observation once, then call wait().",
            )
        if command.source is Source.TELEOP:
            self._teleop.put(command.twist, command.stamp_s, answers=seq, released=command.released)
            return self._applied
        self._policy.put(command.twist, command.stamp_s, answers=seq)
        self._answered = True
        self._applied = self._result(seq)
        return self._applied

    def wait(self, until_s: float) -> None:
        """Go on to the next observation, unless the present one is already that late."""
        if until_s <= self.now() + ROUNDING_S:
            return
        if not self._answered:
            raise BusError("in lockstep time passes only with commands", "Call drive() as policy before wait().")
        self._advance()

    def close(self) -> None:
        """Nothing moves in lockstep without a command, so there is nothing to stop."""
        self._closed.set()

    def _advance(self) -> None:
        self._check_open()
        deadline_s = time.monotonic() + ANSWER_S
        while (newer := self._newer()) is None:
            _pause(deadline_s)
        self._take(*newer)

    def _newer(self) -> tuple[int, Clock] | None:
        newest = self._clock.newest()
        if newest is None or newest.attachment is None or newest.attachment.seq == self._observation.seq:
            return None
        return newest.attachment.seq, newest.message

    def _take(self, seq: int, clock: Clock) -> None:
        self._observation = self._sensors.observe(clock.stamp_s, seq)
        state = self._states.newest()
        self._state = None if state is None else state.message
        self._answered = False

    def _result(self, seq: int) -> Applied:
        deadline_s = time.monotonic() + ANSWER_S
        while True:
            newest = self._results.newest()
            if newest is not None and newest.attachment is not None and newest.attachment.answers == seq:
                return newest.message
            _pause(deadline_s)


def _pause(deadline_s: float) -> None:
    if time.monotonic() > deadline_s:
        raise BusError(f"the robot has not answered for {ANSWER_S:.0f} s", "Check that it is still running.")
    time.sleep(POLL_S)
