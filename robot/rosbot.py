"""The physical ROSbot 2.0: lidar, camera and base as one robot, which says when one of them is lost."""

import threading
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

from lira.hal.bus.sensors import observation_of, same_readings
from lira.hal.clock import is_fresh
from lira.hal.errors import ConfigError, DeviceError
from lira.hal.messages import (
    STOP,
    Applied,
    Command,
    DepthImage,
    DiagnosticStatus,
    LaserScan,
    Observation,
    Reason,
    Source,
)
from lira.hal.port import DeviceHealth
from lira.hal.profile import RobotProfile
from lira.robot.camera.device import CameraDevice
from lira.robot.camera.port import Picture
from lira.robot.core2.device import Core2
from lira.robot.rplidar.device import RPLidar
from lira.robot.settings import Settings
from lira.robot.supervisor import Supervisor

OPEN_S = 20.0  # a CORE2 boots for 2 s and may speak at three speeds
BLIND_S = 0.5  # driven on no older scan than this
ERROR = 2  # level of a status


@dataclass(frozen=True, slots=True)
class Devices:
    """Where the parts are. `lidar` and `camera` None: to be driven without it."""

    base: str
    lidar: str | None = None
    camera: str | None = None
    openni_folder: Path | None = None
    settings: Settings = field(default_factory=Settings)


class Rosbot:
    """Implements `hal.port.Robot`, `MotorSwitch`, `SensorEvents`, `DeviceMonitor` and `SelfDiagnosis`.

    Its clock is the monotonic clock.
    A device that is lost ("lidar", "camera", "base") is opened again by itself; to stand meanwhile is the governor's.
    """

    def __init__(self, profile: RobotProfile, devices: Devices) -> None:
        self._profile = profile
        self._scan: LaserScan | None = None
        self._picture: Picture | None = None
        self._depth: DepthImage | None = None
        self._newest: Observation | None = None
        self._news = threading.Event()  # a scan or a picture; the base is read often enough
        self._blind_spells = 0  # how often a scan came later than `BLIND_S` after the one before
        self._open = False
        self.base = Core2(devices.base, devices.settings.base, profile.control.robot_timeout_s)
        self.lidar: RPLidar | None = None
        self._supervisors = {"base": Supervisor("base", self.base.session)}
        if devices.lidar is not None:
            self.lidar = RPLidar(devices.lidar, profile.lidar, devices.settings.lidar, self._see_scan)
            self._supervisors["lidar"] = Supervisor("lidar", self.lidar.session, self.lidar.rest)
        if devices.camera is not None:
            depth = devices.settings.camera.depth or profile.depth is not None
            camera = CameraDevice(devices.camera, profile.camera, self._see_picture, devices.openni_folder, depth=depth)
            self._supervisors["camera"] = Supervisor("camera", camera.session)

    @property
    def profile(self) -> RobotProfile:
        """The robot's profile."""
        return self._profile

    def open(self) -> None:
        """Bring all devices up at once. Raises `DeviceError` for the first that is missing or wrong."""
        for supervisor in self._supervisors.values():
            supervisor.start()
        try:
            for supervisor in self._supervisors.values():
                supervisor.wait_alive(OPEN_S)
        except (DeviceError, ConfigError):
            self.close()
            raise
        self._open = True

    def read(self) -> Observation:
        """Return the newest of every sensor; what is older than its topic allows is None."""
        if not self._open:
            raise DeviceError("the robot is not open", "Call open() first.")
        last = self._newest
        newest = {"scan": self._scan, "camera": self._picture, "depth": self._depth, **self.base.readings.by_name()}
        observation = observation_of(1 if last is None else last.seq + 1, self.now(), newest)
        if last is None or not same_readings(observation, last):
            self._newest = last = observation
        return last

    def drive(self, command: Command) -> Applied:
        """Send a velocity to the base, zero if it is not finite."""
        twist, source, reason = command.twist, command.source, Reason.OK
        try:
            self.base.drive(twist, command.stamp_s)
        except ValueError:
            twist, source, reason = STOP, Source.NONE, Reason.REFUSED
            self.base.drive(STOP)
        now_s = self.now()
        return Applied(twist, now_s, source, reason, (), command.answers, now_s - command.stamp_s)

    def device_health(self) -> DeviceHealth:
        """What is lost now, how often anything was, and what it has none of."""
        lost = self._lost()  # before the count: what is lost by now is in it
        losses = (
            sum(supervisor.losses for supervisor in self._supervisors.values()) + self.base.losses + self._blind_spells
        )
        return DeviceHealth(lost, losses, tuple(name for name in ("lidar", "camera") if name not in self._supervisors))

    def now(self) -> float:
        """Seconds on the monotonic clock."""
        return time.monotonic()

    def wait(self, until_s: float) -> None:
        """Sleep."""
        time.sleep(max(until_s - time.monotonic(), 0.0))

    def wait_news(self, until_s: float) -> None:
        """Sleep until there is a new scan or picture."""
        if self._news.wait(max(until_s - time.monotonic(), 0.0)):
            self._news.clear()

    def close(self) -> None:
        """Stop the wheels, then the lidar, and let go of all. May be called twice."""
        self._open = False
        self.base.drive(STOP)
        for supervisor in self._supervisors.values():
            supervisor.close()

    def cut_motors(self, off: bool) -> None:
        """Take the motors' power away in the firmware, or give it back: a second emergency stop, below ours."""
        self.base.cut_motors(off)

    def diagnostics(self) -> tuple[DiagnosticStatus, ...]:
        """How the base and the lidar are, and why one of them is lost."""
        told = [self.base.diagnostics()] + ([] if self.lidar is None else [self.lidar.diagnostics()])
        troubles = self.troubles()
        return tuple(
            replace(status, level=ERROR, message=troubles[status.name]) if status.name in troubles else status
            for status in told
        )

    def troubles(self) -> dict[str, str]:
        """What is wrong with which device, each with its remedy; empty while all work."""
        return {name: self._trouble(name) for name in self._lost()}

    def _trouble(self, name: str) -> str:
        failure = self._supervisors[name].failure
        return str(failure) if failure is not None else f"the {name} is silent. Check its power and plug."

    def _lost(self) -> tuple[str, ...]:
        """Which devices do not work now."""
        lost = [name for name, supervisor in self._supervisors.items() if not supervisor.alive]
        if "lidar" in self._supervisors and "lidar" not in lost and self._is_blind():
            lost.append("lidar")
        if not self.base.answers and "base" not in lost:
            lost.append("base")
        return tuple(lost)

    def _is_blind(self) -> bool:
        scan = self._scan
        return scan is None or not is_fresh(scan.stamp_s, self.now(), BLIND_S)

    def _see_scan(self, scan: LaserScan) -> None:
        if self._scan is not None:
            self._blind_spells += self._is_blind()
        self._scan = scan
        self._news.set()

    def _see_picture(self, picture: Picture | DepthImage) -> None:
        if isinstance(picture, DepthImage):
            self._depth = picture
        else:
            self._picture = picture
        self._news.set()
