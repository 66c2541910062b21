"""Robots on buses of their own, for tests."""

import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import Any

from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.topics import CMD_VEL, Topic
from lira.hal.client.connect import open_remote
from lira.hal.client.remote import RemoteRobot
from lira.hal.messages import Observation
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.testing import NullRobot
from lira.tools.launch.processes import free_port

PROFILE = load_profile("thesis-sim")


def new_name() -> str:
    return f"t{uuid.uuid4().hex}"


def new_endpoint() -> str:
    return f"127.0.0.1:{free_port()}"


def real_time_null(kind: type[NullRobot] = NullRobot) -> NullRobot:
    return kind(PROFILE, time.monotonic, time.sleep)


class StuckRobot(NullRobot):
    """Its sensors can be made to hang."""

    _free: threading.Event | None = None

    def hang(self) -> None:
        self._free = threading.Event()

    def go_on(self) -> None:
        assert self._free is not None
        self._free.set()

    def read(self) -> Observation:
        if self._free is not None:
            self._free.wait(20.0)
        return super().read()


class Served:
    """A robot that is served from a thread; `failure` is what the server ended with. On a `floor` it has no arena."""

    def __init__(self, inner: NullRobot, *, lockstep: bool = False, floor: bool = False, **more) -> None:
        self.inner = inner
        self.name, self.endpoint = new_name(), new_endpoint()
        self.stop, self.is_ready = threading.Event(), threading.Event()
        self.failure: BaseException | None = None
        self.governed = GovernedRobot(inner)
        self._bus = Bus(self.name, listen=self.endpoint)
        arena = None if floor else inner
        self._server = HalServer(self.governed, self._bus, arena, lockstep=lockstep, ready=self.is_ready.set, **more)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._server.run(self.stop)
        except BaseException as error:  # noqa: BLE001 - the test looks at it
            self.failure = error

    def end(self) -> None:
        self.stop.set()
        self.join()
        assert self._bus.close()

    def join(self) -> None:
        self._thread.join(10.0)
        assert not self._thread.is_alive()


@contextmanager
def served(inner: NullRobot, *, lockstep: bool = False, floor: bool = False, **more) -> Iterator[Served]:
    robot = Served(inner, lockstep=lockstep, floor=floor, **more)
    try:
        wait_for(lambda: robot.is_ready.is_set() or robot.failure is not None, 10.0)
        yield robot
    finally:
        robot.end()


@contextmanager
def paired() -> Iterator[tuple[Bus, Bus]]:
    """A robot's bus and a client's, once both of their links are up: while one is missing, messages may overtake."""
    name, endpoint = new_name(), new_endpoint()
    robot, client = Bus(name, listen=endpoint), Bus(name, connect=endpoint)
    try:
        wait_for(lambda: robot.links() == client.links() == 2)
        yield robot, client
    finally:
        assert client.close()
        assert robot.close()


@contextmanager
def joined(robot: Served) -> Iterator[Bus]:
    bus = Bus(robot.name, connect=robot.endpoint)
    try:
        yield bus
    finally:
        assert bus.close()


def ready(bus: Bus, topic: Topic[Any] = CMD_VEL) -> Publisher[Any]:
    """Return a publisher once the robot's reader is known to the bus: what is put before, and not latched, is lost."""
    with bus._session.declare_publisher(f"{bus.robot}/{topic.key}") as asks:
        wait_for(lambda: asks.matching_status.matching)
    return bus.publisher(topic)


@contextmanager
def remote(robot: Served) -> Iterator[RemoteRobot]:
    with joined(robot) as bus, closing(open_remote(bus)) as client:
        yield client


def wait_for(condition: Callable[[], bool], timeout_s: float = 20.0) -> None:
    """For what is certain to come: only what hangs takes that long."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, "never happened"
        time.sleep(0.005)
