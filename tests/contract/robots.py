"""The robots that have to fit the contract. To add one, write a context manager that yields a `Rig` and list it."""

import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.client.remote import RemoteArena, RemoteRobot
from lira.hal.port import Arena, Robot
from lira.hal.profile import Depth, load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.testing import NullRobot
from lira.robot.rosbot import Devices, Rosbot
from lira.robot.settings import BaseSettings, LidarSettings, Settings
from lira.sim_backend.emulators.core2 import Firmware
from lira.sim_backend.emulators.wired_twin import WiredTwin
from lira.sim_backend.twin import Twin
from lira.tools.launch.processes import free_port

ROSBOT = load_profile("rosbot2")
PROFILE = msgspec.structs.replace(  # with every sensor that there is
    load_profile("thesis-sim"),
    depth=Depth(width_px=16, height_px=12, range_min_m=0.1, range_max_m=4.0),
    imu=ROSBOT.imu,
    battery=ROSBOT.battery,
    ranger=ROSBOT.ranger,
)


@dataclass(frozen=True)
class Rig:
    """An open robot, the one that measures for it, the truth about it, and how its time passes."""

    robot: Robot
    source: Robot
    arena: Arena
    real_time: bool = False  # its time passes by itself
    stepped: bool = False  # its time passes with policy's commands only, a period each


@contextmanager
def served(inner: NullRobot | Twin, *, lockstep: bool) -> Iterator[Rig]:
    """Put a robot on a bus of its own, and open it from the other end."""
    name, endpoint, stop = f"t{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}", threading.Event()
    robot_bus, client_bus = Bus(name, listen=endpoint), Bus(name, connect=endpoint)
    server = threading.Thread(
        target=HalServer(GovernedRobot(inner), robot_bus, inner, lockstep=lockstep).run, args=[stop]
    )
    server.start()
    robot = RemoteRobot(client_bus)
    try:
        robot.open()
        yield Rig(robot, inner, RemoteArena(robot), real_time=not lockstep, stepped=lockstep)
    finally:
        robot.close()
        stop.set()
        server.join(10.0)
        assert client_bus.close()
        assert robot_bus.close()
    assert not server.is_alive()


@contextmanager
def null() -> Iterator[Rig]:
    inner = NullRobot(PROFILE)
    robot = GovernedRobot(inner)
    robot.open()
    yield Rig(robot, inner, inner)
    robot.close()


@contextmanager
def null_real_time() -> Iterator[Rig]:
    inner = NullRobot(PROFILE, time.monotonic, time.sleep)
    with served(inner, lockstep=False) as rig:
        yield rig


@contextmanager
def null_lockstep() -> Iterator[Rig]:
    inner = NullRobot(PROFILE)
    with served(inner, lockstep=True) as rig:
        yield rig


def make_twin(realtime_factor: float | None = None) -> Twin:
    return Twin(PROFILE, "line", realtime_factor=realtime_factor)


@contextmanager
def twin() -> Iterator[Rig]:
    inner = make_twin()
    robot = GovernedRobot(inner)
    robot.open()
    yield Rig(robot, inner, inner)
    robot.close()


@contextmanager
def twin_real_time() -> Iterator[Rig]:
    inner = make_twin(1.0)
    with served(inner, lockstep=False) as rig:
        yield rig


@contextmanager
def twin_lockstep() -> Iterator[Rig]:
    inner = make_twin()
    with served(inner, lockstep=True) as rig:
        yield rig


WIRED = Settings(lidar=LidarSettings(spin_up_s=0.0), base=BaseSettings(boot_s=0.1))


@contextmanager
def rosbot_on_emulators() -> Iterator[Rig]:
    with TemporaryDirectory() as name:
        folder = Path(name)
        wired = WiredTwin(make_twin(1.0), folder, firmware=Firmware(boot_s=0.05))
        devices = Devices(str(folder / "core2"), str(folder / "rplidar"), wired.url, settings=WIRED)
        # A network camera has no depth.
        inner = Rosbot(msgspec.structs.replace(PROFILE, depth=None), devices)
        robot = GovernedRobot(inner)
        try:
            robot.open()
            yield Rig(robot, inner, wired, real_time=True)
        finally:
            robot.close()
            wired.close()


# `real_time` and `stepped` robots by name: some promises make no sense for them.
REAL_TIME = {"null over zenoh", "twin over zenoh", "rosbot on emulators"}
STEPPED = {"null over zenoh in lockstep", "twin over zenoh in lockstep"}

ROBOTS: dict[str, Callable[[], AbstractContextManager[Rig]]] = {
    "null": null,
    "null over zenoh": null_real_time,
    "null over zenoh in lockstep": null_lockstep,
    "twin": twin,
    "twin over zenoh": twin_real_time,
    "twin over zenoh in lockstep": twin_lockstep,
    "rosbot on emulators": rosbot_on_emulators,
}
