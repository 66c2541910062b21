"""A robot that is not there: it moves exactly as told through an empty world. For tests, benches and contracts."""

import math
import threading
from collections.abc import Callable

import numpy as np

from lira.hal.messages import (
    STOP,
    Applied,
    BatteryState,
    Command,
    CourseState,
    Episode,
    Image,
    Imu,
    LaserScan,
    Observation,
    Odometry,
    Reason,
)
from lira.hal.profile import RobotProfile

GRAY = 128
BATTERY_V = 12.0
ODOMETRY_HZ = 20.0
BATTERY_HZ = 1.0


class NullRobot:
    """Implements `hal.port.Robot` and `hal.port.Arena`. Its course is the x axis, without end or obstacle.

    Without a `clock` time passes only in `wait`. With one (such as `time.monotonic`, and a `sleep` to go with it) it
    passes by itself. Every scan shows open space, every image is gray.
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
        lidar, camera = profile.lidar, profile.camera
        full_turn = lidar.fov_rad > 2 * math.pi - 1e-3
        self._increment_rad = lidar.fov_rad / (lidar.beams if full_turn else max(lidar.beams - 1, 1))
        self._ranges = np.full(lidar.beams, np.inf, np.float32)
        self._pixels = np.full((camera.height_px, camera.width_px, 3), GRAY, np.uint8)

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
        lidar = self._profile.lidar
        x_m, y_m, yaw_rad = self._pose
        odometry_s = self._last(ODOMETRY_HZ)
        return Observation(
            self._seq,
            self._time_s,
            scan=LaserScan(
                self._last(lidar.rate_hz),
                -lidar.fov_rad / 2,
                self._increment_rad,
                lidar.range_min_m,
                lidar.range_max_m,
                self._ranges,
            ),
            image=Image(self._last(self._profile.camera.rate_hz), self._pixels),
            odom=Odometry(odometry_s, x_m, y_m, yaw_rad, self._twist.linear_m_s, self._twist.angular_rad_s),
            imu=Imu(odometry_s, yaw_rad, self._twist.angular_rad_s, 0.0, 0.0),
            battery=BatteryState(self._last(BATTERY_HZ), BATTERY_V),
        )

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
