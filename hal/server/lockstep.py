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
POLL_S = 0.0001
SERVICE_S = 0.002  # questions and the emergency stop are looked at so often, and before each command
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
        since_s = shown_s = serve_s = time.monotonic()
        while not stop.is_set():
            answer, now_s = self._answer(), time.monotonic()
            if answer is not None or now_s >= serve_s:
                self._serve()
                serve_s = now_s + SERVICE_S
            if answer is not None and answer.answers == self._observation.seq:  # nobody has put the robot elsewhere
                self._take_teleop()
                return _free(answer)
            if now_s - shown_s > REPEAT_S:
                self._show()
                shown_s = now_s
            time.sleep(POLL_S if now_s - since_s < IDLE_S else IDLE_POLL_S)
        return None

    def _serve(self) -> None:
        """Answer questions, which may put the robot elsewhere, and see whether somebody pressed the emergency stop."""
        self._info_service.serve(self._show)
        self._estop.serve()
        if self._inlet.estop():
            self._robot.press_estop()

    def _answer(self) -> Command | None:
        """Policy's command that answers the observation. It is polled first: what was put before it is here by then."""
        seq = self._observation.seq
        answers = [command for command in self._inlet.policy(self._robot.now()) if command.answers == seq]
        return answers[-1] if answers else None

    def _take_teleop(self) -> None:
        for command in self._inlet.teleop(self._robot.now()):
            if command.answers in (-1, self._observation.seq):
                with self._boundary.guard(TELEOP.key):
                    self._robot.submit(_free(command))


def _free(command: Command) -> Command:
    """Take a command for anybody's: time stands between two commanders, so a lease would never end."""
    return replace(command, epoch=0)
