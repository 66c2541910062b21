"""The HAL server in lockstep: time stands still until a command names the observation that was sent.

Publish observation k, wait for policy's command that answers k, drive, publish what was applied, advance one period.
A teleop command that was put before it is taken first. All of it travels reliably, on one link and at one priority,
so what was put first is there first. With one seed, two runs are the same to the bit.
"""

import threading
import time
from dataclasses import replace

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED, CLOCK, IN_LOCKSTEP, SIM_STATE, TELEOP
from lira.hal.messages import Clock, Command, Observation
from lira.hal.port import Arena
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.command_reader import Inlet
from lira.hal.server.estop_service import EstopService
from lira.hal.server.info_service import InfoService
from lira.hal.server.sensor_publisher import SensorPublisher

REPEAT_S = 1.0  # wall time after which an unanswered observation is sent again, to whoever listens by now
POLL_S = 0.0002
IDLE_S = 0.1  # after this long without an answer, polls are rarer
IDLE_POLL_S = 0.002


class LockstepLoop:
    """Serves one robot whose time passes only in `wait`."""

    def __init__(
        self,
        robot: GovernedRobot,
        bus: Bus,
        sensors: SensorPublisher,
        info_service: InfoService,
        arena: Arena | None,
    ) -> None:
        self._robot = robot
        self._info_service = info_service
        self._arena = arena
        self._boundary = bus.boundary
        self._inlet = Inlet(bus, robot.profile.control)
        self._estop = EstopService(robot, bus)
        self._sensors = sensors
        self._applied = bus.publisher(APPLIED, IN_LOCKSTEP)
        self._state = bus.publisher(SIM_STATE, IN_LOCKSTEP)
        self._clock = bus.publisher(CLOCK, IN_LOCKSTEP)
        self._observation = Observation(0, 0.0)

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop` is set."""
        while not stop.is_set():
            self._show()
            command = self._next_command(stop)
            if command is None:
                return
            applied = self._robot.drive(command)
            with self._boundary.guard(APPLIED.key):
                self._applied.put(applied, self._robot.now(), seq=command.answers, answers=command.answers)
            self._robot.wait(self._robot.now() + self._robot.profile.period_s)

    def _show(self) -> None:
        """Publish the newest observation, the clock last: whoever sees it has the rest."""
        self._observation = observation = self._robot.read()
        now_s, seq = self._robot.now(), observation.seq
        self._sensors.put(observation, now_s)
        self._sensors.put_pictures(observation, now_s)
        if self._arena is not None:
            with self._boundary.guard(SIM_STATE.key):
                self._state.put(self._arena.state(), now_s, seq=seq)
        self._clock.put(Clock(now_s), now_s, seq=seq)

    def _next_command(self, stop: threading.Event) -> Command | None:
        """Wait for the command that answers the observation; None once `stop` is set."""
        since_s = shown_s = time.monotonic()
        while not stop.is_set():
            self._info_service.serve(self._show)
            self._estop.serve()
            if self._inlet.estop():
                self._robot.press_estop()
            answer = self._answer()
            if answer is not None:
                return answer
            now_s = time.monotonic()
            if now_s - shown_s > REPEAT_S:
                self._show()
                shown_s = now_s
            time.sleep(POLL_S if now_s - since_s < IDLE_S else IDLE_POLL_S)
        return None

    def _answer(self) -> Command | None:
        seq, now_s = self._observation.seq, self._robot.now()
        # Policy is polled first: what teleop put before it has arrived by then.
        answers = [command for command in self._inlet.policy(now_s) if command.answers == seq]
        if not answers:
            return None
        for command in self._inlet.teleop(now_s):
            if command.answers in (-1, seq):
                with self._boundary.guard(TELEOP.key):
                    self._robot.submit(_free(command))
        return _free(answers[-1])


def _free(command: Command) -> Command:
    """Take a command for anybody's: time stands between two commanders, so a lease would never end."""
    return replace(command, epoch=0)
