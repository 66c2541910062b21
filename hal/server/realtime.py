"""The HAL server in real time: four threads, and the one that moves the wheels waits for none of the others.

- commands: polls them, lets the governor judge, moves the base, strikes when they stop coming;
- applied: tells the bus what came of them;
- sensors: opens and reads the robot, publishes what is new, answers queries;
- pictures: compresses and sends them, if anybody listens, and skips what it has no time for.
"""

import threading
import time
from collections import deque
from collections.abc import Callable

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED, CMD_VEL, SIM_STATE
from lira.hal.messages import Applied, Observation, Reason
from lira.hal.port import Arena
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.command_reader import Inlet
from lira.hal.server.command_watch import CommandWatch
from lira.hal.server.info_service import InfoService
from lira.hal.server.sensor_publisher import SensorPublisher

POLL_S = 0.002  # how long a command may lie
WATCHDOG_S = 0.02
SENSOR_S = 0.005  # how long a new reading may lie
JOIN_S = 2.0
# How long one thread may hold the interpreter while others wait for it. By default it is ten times as long, and the
# thread that moves the wheels needs it several times a poll: who answers a flood of questions would hold it up.
SWITCH_S = 0.0005
UNTOLD = 16  # what was applied and could not be told yet, at most


class CommandLoop:
    """Moves the wheels: law 1 stands on this page. Nothing here waits for the bus: `events` tells what was applied.

    `alive` is called with every look of the watchdog: whoever supervises the process hears by it that the loop turns.
    `watch` gets to know who commands.
    """

    def __init__(
        self,
        robot: GovernedRobot,
        bus: Bus,
        events: "AppliedLoop",
        watch: CommandWatch,
        alive: Callable[[], None] = lambda: None,
    ) -> None:
        self._robot = robot
        self._inlet = Inlet(bus, robot.profile.control, watch)
        self._boundary = bus.boundary
        self._events = events
        self._alive = alive

    def run(self, stop: threading.Event) -> None:
        """Obey and watch until `stop` is set; leaves the wheels at zero, whatever happens."""
        watch_s = publish_s = time.monotonic()
        told: Reason | None = None
        try:
            while not stop.wait(POLL_S):
                # Time-outs first: nothing that others send holds them up.
                applied = self._robot.tick() if time.monotonic() >= watch_s else None
                if commanded := self._obey():
                    applied = self._robot.tick()
                if applied is None:
                    continue
                now_s = time.monotonic()
                watch_s = now_s + WATCHDOG_S
                self._alive()
                if commanded or applied.reason is not told or now_s >= publish_s:
                    publish_s = now_s + 1.0 / APPLIED.rate_hz
                    told = applied.reason
                    self._events.offer(applied)
        finally:
            self._robot.halt()

    def _obey(self) -> bool:
        """Hand new commands to the governor, the person's first. Returns whether there were any."""
        if self._inlet.estop():
            self._robot.press_estop()
        now_s = self._robot.now()
        commands = self._inlet.teleop(now_s) + self._inlet.policy(now_s)
        for command in commands:
            with self._boundary.guard(CMD_VEL.key):
                self._robot.submit(command)
        return bool(commands)


class AppliedLoop:
    """Tells what was applied, in order; a bus that takes nothing loses the oldest of it and holds nobody up."""

    def __init__(self, robot: GovernedRobot, bus: Bus) -> None:
        self._robot = robot
        self._boundary = bus.boundary
        self._publisher = bus.publisher(APPLIED)
        self._untold: deque[Applied] = deque(maxlen=UNTOLD)
        self._offered = threading.Event()

    def offer(self, applied: Applied) -> None:
        """Leave one to be told."""
        self._untold.append(applied)
        self._offered.set()

    def run(self, stop: threading.Event) -> None:
        """Tell until `stop` is set."""
        while not stop.is_set():
            self._offered.wait(JOIN_S / 4)
            self._offered.clear()
            while self._untold:
                applied = self._untold.popleft()
                with self._boundary.guard(APPLIED.key):
                    self._publisher.put(applied, self._robot.now(), answers=applied.answers)


class SensorLoop:
    """Publishes what is new, except pictures, which it hands to `PictureLoop`."""

    def __init__(
        self,
        robot: GovernedRobot,
        bus: Bus,
        sensors: SensorPublisher,
        pictures: "PictureLoop",
        info_service: InfoService,
        arena: Arena | None,
    ) -> None:
        self._robot = robot
        self._sensors = sensors
        self._boundary = bus.boundary
        self._pictures = pictures
        self._info_service = info_service
        self._arena = arena
        self._state = bus.publisher(SIM_STATE)
        self._state_due_s = 0.0

    def run(self, stop: threading.Event) -> None:
        """Publish until `stop` is set."""
        while not stop.is_set():
            self._show()
            self._info_service.serve(self._show)
            self._robot.pass_time(self._robot.now() + SENSOR_S)

    def _show(self) -> None:
        observation, now_s = self._robot.read(), self._robot.now()
        self._sensors.put(observation, now_s)
        self._pictures.offer(observation)
        if self._arena is not None and now_s >= self._state_due_s:
            self._state_due_s = now_s + 1.0 / SIM_STATE.rate_hz
            with self._boundary.guard(SIM_STATE.key):
                self._state.put(self._arena.state(), now_s, seq=observation.seq)


class PictureLoop:
    """Sends the newest pictures; one that is still waiting when the next comes is dropped."""

    def __init__(self, robot: GovernedRobot, sensors: SensorPublisher) -> None:
        self._robot = robot
        self._sensors = sensors
        self._newest: Observation | None = None
        self._offered = threading.Condition()

    def offer(self, observation: Observation) -> None:
        """Leave an observation to be sent."""
        with self._offered:
            self._newest = observation
            self._offered.notify()

    def run(self, stop: threading.Event) -> None:
        """Send until `stop` is set."""
        while not stop.is_set():
            with self._offered:
                self._offered.wait_for(lambda: self._newest is not None, timeout=JOIN_S / 4)
                observation, self._newest = self._newest, None
            if observation is not None:
                self._sensors.put_pictures(observation, self._robot.now())
