"""A robot that is not there: it moves exactly as told through an empty world. For tests, benches and contracts."""

import math
import threading
from collections.abc import Callable

import msgspec
import numpy as np

from lira.hal.bus.sensors import Stamped, observation_of
from lira.hal.bus.topics import BATTERY, ODOM
from lira.hal.messages import (
    STOP,
    Applied,
    BatteryState,
    Command,
    CourseState,
    DepthImage,
    Episode,
    Image,
    Imu,
    LaserScan,
    Observation,
    Odometry,
    Range,
    Reason,
)
from lira.hal.profile import Lidar, RobotProfile

GRAY = 128
SMALL_PX = (64, 48)


def small_pictures(profile: RobotProfile) -> RobotProfile:
    """Return the profile with a small camera: where nobody looks at the pictures, they need not take time."""
    camera = msgspec.structs.replace(profile.camera, width_px=SMALL_PX[0], height_px=SMALL_PX[1])
    return msgspec.structs.replace(profile, camera=camera)


class NullRobot:
    """Implements `hal.port.Robot` and `hal.port.Arena`. Its course is the x axis, without end or obstacle.

    Without a `clock` time passes only in `wait`. With one (such as `time.monotonic`, and a `sleep` to go with it) it
    passes by itself. It has every sensor of its profile: scans, depths and ranges show open space, images are gray.
    """

    def __init__(
        self,
        profile: RobotProfile,
        clock: Callable[[], float] | None = None,
        sleep: Callable[[float], None] = lambda _: None,
    ) -> None:
        self._profile = profile
        self._clock = clock
        self._sleep = sleep
        self._time_s = 0.0 if clock is None else clock()
        self._twist = STOP
        self._pose = (0.0, 0.0, 0.0)
        self._seq = 0
        self._newest: Observation | None = None
        self._lock = threading.Lock()  # motion is asked for by whoever drives and whoever reads
        camera, depth = profile.camera, profile.depth
        self._ranges = np.full(profile.lidar.beams, np.inf, np.float32)
        self._increment_rad = profile.lidar.increment_rad
        self._pixels = np.full((camera.height_px, camera.width_px, 3), GRAY, np.uint8)
        self._depths = np.zeros((0, 0) if depth is None else (depth.height_px, depth.width_px), np.uint16)

    @property
    def profile(self) -> RobotProfile:
        """The robot's profile."""
        return self._profile

    def open(self) -> None:
        """Nothing to bring up."""

    def now(self) -> float:
        """Seconds on its clock."""
        return self._time_s if self._clock is None else self._clock()

    def wait(self, until_s: float) -> None:
        """Let time pass."""
        if self._clock is None:
            self._advance(until_s)
        else:
            self._sleep(max(until_s - self._clock(), 0.0))

    def drive(self, command: Command) -> Applied:
        """Move exactly as told from now on."""
        self._advance(self.now())
        self._twist = command.twist
        age_s = self._time_s - command.stamp_s
        return Applied(command.twist, self._time_s, command.source, Reason.OK, (), command.answers, age_s)

    def read(self) -> Observation:
        """Return the newest of every sensor; each is new at its own rate."""
        self._advance(self.now())
        if self._newest is None or self._newest.stamp_s != self._time_s:
            self._newest = self._capture()
        return self._newest

    def _capture(self) -> Observation:
        self._seq += 1
        profile, twist, (x_m, y_m, yaw_rad) = self._profile, self._twist, self._pose
        newest: dict[str, Stamped] = {
            "scan": self._scan(profile.lidar),
            "camera": Image(self._last(profile.camera.rate_hz), self._pixels),
            "odom": Odometry(self._last(ODOM.rate_hz), x_m, y_m, yaw_rad, twist.linear_m_s, twist.angular_rad_s),
        }
        if profile.depth is not None:
            newest["depth"] = DepthImage(self._last(profile.depth.rate_hz), self._depths)
        if profile.imu is not None:
            newest["imu"] = Imu(self._last(profile.imu.rate_hz), yaw_rad, twist.angular_rad_s, 0.0, 0.0)
        if profile.battery is not None:
            newest["battery"] = BatteryState(self._last(BATTERY.rate_hz), profile.battery.full_v)
        for ranger in profile.ranger:
            stamp_s, limits = self._last(ranger.rate_hz), (ranger.range_min_m, ranger.range_max_m)
            newest[ranger.frame_id] = Range(stamp_s, ranger.frame_id, math.inf, *limits)
        return observation_of(self._seq, self._time_s, newest)

    def _scan(self, lidar: Lidar) -> LaserScan:
        limits = lidar.range_min_m, lidar.range_max_m
        return LaserScan(self._last(lidar.rate_hz), -lidar.fov_rad / 2, self._increment_rad, *limits, self._ranges)

    def close(self) -> None:
        """Stop."""
        self._advance(self.now())
        self._twist = STOP

    def reset(self, episode: Episode) -> None:
        """Stand on the x axis again."""
        self._advance(self.now())
        self._twist = STOP
        self._pose = (episode.start_m, episode.lateral_m, episode.yaw_rad)
        self._newest = None

    def state(self) -> CourseState:
        """Ground truth now."""
        self._advance(self.now())
        x_m, y_m, yaw_rad = self._pose
        twist = self._twist
        return CourseState(
            self._time_s, x_m, y_m, yaw_rad, twist.linear_m_s, twist.angular_rad_s, x_m, y_m, clearance_m=math.inf
        )

    def _last(self, rate_hz: float) -> float:
        """When a sensor of this rate last measured."""
        return math.floor(self._time_s * rate_hz + 1e-6) / rate_hz

    def _advance(self, until_s: float) -> None:
        with self._lock:
            self._move(max(until_s - self._time_s, 0.0))
            self._time_s = max(until_s, self._time_s)

    def _move(self, dt_s: float) -> None:
        x_m, y_m, yaw_rad = self._pose
        turn_rad = self._twist.angular_rad_s * dt_s
        # The chord of the arc; np.sinc(a / pi) is sin(a) / a.
        chord_m = self._twist.linear_m_s * dt_s * float(np.sinc(turn_rad / 2 / math.pi))
        heading_rad = yaw_rad + turn_rad / 2
        self._pose = (x_m + chord_m * math.cos(heading_rad), y_m + chord_m * math.sin(heading_rad), yaw_rad + turn_rad)
