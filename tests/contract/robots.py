"""The robots that have to fit the contract. To add one, write a context manager that yields a `Rig` and list it."""

import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import RawSample
from lira.hal.bus.sensors import SENSORS
from lira.hal.bus.services import LOCKSTEP, Info
from lira.hal.bus.topics import CMD_VEL, SIM_STATE
from lira.hal.client.connect import open_remote
from lira.hal.client.remote import RemoteArena
from lira.hal.messages import Command, CourseState, Episode
from lira.hal.messages.ros.codec import encode
from lira.hal.port import Arena, Robot
from lira.hal.profile import Depth, load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.testing import NullRobot
from lira.robot.ros2.robot import Interface, Ros2Robot
from lira.robot.rosbot import Devices, Rosbot
from lira.robot.settings import BaseSettings, LidarSettings, Settings
from lira.sim_backend.emulators.core2 import Firmware
from lira.sim_backend.emulators.wired_twin import WiredTwin
from lira.sim_backend.twin import Twin
from lira.tools.launch.processes import free_port
from lira.tools.recording.layout import Head
from lira.tools.recording.reader import Recording
from lira.tools.recording.recorded_robot import RecordedRobot
from lira.tools.recording.writer import RecordingWriter

ROSBOT, SIM = load_profile("rosbot2"), load_profile("thesis-sim")
PROFILE = msgspec.structs.replace(  # with every sensor that there is, and in short steps
    SIM,
    control=msgspec.structs.replace(SIM.control, rate_hz=20.0),
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
    stamps_s: float = 1e-6  # how far a stamp may be off: far from zero a float does not hold all nanoseconds
    ahead_s: float = 0.0  # of the source's clock: on the bus it counts from 1970


@contextmanager
def served(inner: NullRobot | Twin, *, lockstep: bool) -> Iterator[Rig]:
    """Put a robot on a bus of its own, and open it from the other end."""
    name, endpoint, stop = f"t{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}", threading.Event()
    robot_bus, client_bus = Bus(name, listen=endpoint), Bus(name, connect=endpoint)
    server = threading.Thread(
        target=HalServer(GovernedRobot(inner), robot_bus, inner, lockstep=lockstep).run, args=[stop]
    )
    server.start()
    try:
        with closing(open_remote(client_bus)) as robot:
            stamps_s = 1e-6 if lockstep else 1e-5
            yield Rig(robot, inner, RemoteArena(robot), not lockstep, lockstep, stamps_s, robot_bus.offset_s)
    finally:
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


class RosPeer:
    """A null robot as ROS 2 shows one: messages without anything of ours beside them, and a twist drives it."""

    def __init__(self, inner: NullRobot, bus: Bus) -> None:
        self._inner, self._bus = inner, bus
        self._commands = bus.reader(CMD_VEL, depth=16)
        self._sent: dict[str, float] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(0.005):
            for received in self._commands.poll():
                self._inner.drive(Command(received.message, self._inner.now()))
            seen = self._inner.read()
            for sensor in SENSORS:
                value = sensor.value(seen)
                if value is not None and self._sent.get(sensor.name) != value.stamp_s:
                    self._sent[sensor.name] = value.stamp_s
                    message = value if sensor.compress is None else sensor.compress(value, PROFILE)
                    self._bus.put_raw(sensor.topic, encode(message))

    def reset(self, episode: Episode) -> None:
        """Start afresh, and wait until what its sensors send belongs to the new episode."""
        self._inner.reset(episode)
        time.sleep(0.25)

    def state(self) -> CourseState:
        return self._inner.state()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


@contextmanager
def null_over_ros() -> Iterator[Rig]:
    name, endpoint = f"t{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}"
    far, near = Bus(name, listen=endpoint), Bus(name, connect=endpoint)
    inner = NullRobot(PROFILE, time.monotonic, time.sleep)
    peer = RosPeer(inner, far)
    robot = GovernedRobot(Ros2Robot(PROFILE, near, Interface()))
    try:
        robot.open()
        # It estimates the peer's clock from what comes, and takes nothing for later than that.
        yield Rig(robot, inner, peer, real_time=True, stamps_s=0.05)
    finally:
        robot.close()
        peer.close()
        assert near.close()
        assert far.close()


RECORDED_S = 30.0
EPOCH = 3


def record(robot: NullRobot, folder: Path) -> None:
    """Record a robot that nobody drives, as `lira record` would."""
    began_s = robot.now()
    head = Head("rosbot", "0", 0, round(began_s * 1e9), Info(robot.profile, LOCKSTEP, EPOCH))
    with RecordingWriter(folder, head, split_bytes=2**30) as writer:
        while robot.now() < began_s + RECORDED_S:
            seen, now_ns = robot.read(), round(robot.now() * 1e9)
            found = [(sensor.topic, sensor.compress, sensor.value(seen)) for sensor in SENSORS]
            for topic, compress, value in [*found, (SIM_STATE, None, robot.state())]:
                if value is not None:
                    message = value if compress is None else compress(value, robot.profile)
                    beside = Attachment(EPOCH, seen.seq, now_ns).to_bytes()
                    writer.add(RawSample(topic.key, topic.ros_type, encode(message), beside, 0.0), now_ns, now_ns)
            robot.wait(robot.now() + 0.05)


@cache
def recorded() -> TemporaryDirectory[str]:
    """A folder with the recording of a null robot that nobody drives; it goes when this process ends."""
    folder = TemporaryDirectory()
    record(NullRobot(PROFILE), Path(folder.name) / "rec")
    return folder


@contextmanager
def recording() -> Iterator[Rig]:
    played = RecordedRobot(Recording(Path(recorded().name) / "rec"))
    robot = GovernedRobot(played)
    robot.open()
    yield Rig(robot, played, played)
    robot.close()


# `real_time` and `stepped` robots by name: some promises make no sense for them.
REAL_TIME = {"null over zenoh", "twin over zenoh", "null over ROS 2", "rosbot on emulators"}
STILL = {"recording"}  # where it goes was decided when it was recorded: nowhere
STEPPED = {"null over zenoh in lockstep", "twin over zenoh in lockstep"}

ROBOTS: dict[str, Callable[[], AbstractContextManager[Rig]]] = {
    "null": null,
    "null over zenoh": null_real_time,
    "null over zenoh in lockstep": null_lockstep,
    "null over ROS 2": null_over_ros,
    "recording": recording,
    "twin": twin,
    "twin over zenoh": twin_real_time,
    "twin over zenoh in lockstep": twin_lockstep,
    "rosbot on emulators": rosbot_on_emulators,
}
