"""The digital twin: a robot adapter whose floor is a scene, and an arena that knows the truth."""

import math
import threading
import time
from collections.abc import Iterator

import msgspec

from lira.hal.bus.sensors import SENSORS, Stamped, observation_of, same_readings
from lira.hal.errors import ConfigError, DeviceError
from lira.hal.messages import STOP, Applied, Command, CourseState, Episode, Observation, Reason, Source, Twist
from lira.hal.profile import Base, RobotProfile
from lira.sim_backend.body import Body
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.course import Course, footprint_radius_m
from lira.sim_backend.layout import Layout, build
from lira.sim_backend.scenes.opening import Renderer, settle
from lira.sim_backend.sensors import ROUNDING_S, Sensors
from lira.sim_backend.shifts import surroundings
from lira.sim_backend.world import World

ODOMETRY_PERIOD_S = 0.05
NAMES = {sensor.field: sensor.name for sensor in SENSORS}


class Twin:
    """A simulated robot in a world; implements `hal.port.Robot` and `hal.port.Arena`.

    `world` is a name, a path or a `World`. With `realtime_factor` None the time belongs to the caller and passes only
    in `wait`; with a number it passes by itself, that many times as fast as the monotonic clock. It never runs back,
    not even over a reset. `drive` may be called from any thread and never waits for a picture.

    `renderer` is what draws and measures the floor: "sketch" needs nothing more, "tiny" and "egl" are pybullet's, and
    "auto" is pybullet where it is installed. Raises `ConfigError` for an unknown world, a bad factor, or if pybullet is
    asked for and missing.
    """

    def __init__(
        self,
        profile: RobotProfile,
        world: str | World,
        *,
        layout: int = 0,
        seed: int = 0,
        realtime_factor: float | None = None,
        renderer: Renderer = "auto",
    ) -> None:
        if realtime_factor is not None and not 0.0 < realtime_factor < math.inf:
            raise ConfigError(f"real-time factor {realtime_factor} is not positive", "Use 1 for real time.")
        self._profile = profile
        self.world = load_world(world) if isinstance(world, str) else world
        self._renderer = settle(renderer, self.world)
        self._seed = seed
        self._factor = realtime_factor
        self._began_s = time.monotonic()
        self._sensors: Sensors | None = None
        self._newest: Observation | None = None
        self._seq = 0
        # Rendering is slow, motion is not: whoever drives needs the second lock only. Taken in this order.
        self._sensor_lock = threading.Lock()
        self._lock = threading.Lock()
        self._place = surroundings(self.world, profile, layout)
        self._body = Body(profile.base, Course(build(self._place[0], layout), footprint_radius_m(profile.base)))

    @property
    def profile(self) -> RobotProfile:
        """The robot's profile."""
        return self._profile

    @property
    def info(self) -> bytes:
        """What it says about its world to whoever asks: the world as JSON."""
        return msgspec.json.encode(self.world)

    @property
    def layout(self) -> Layout:
        """The floor as it is now."""
        return self._body.course.layout

    @property
    def renderer(self) -> str:
        """What draws the pictures: "sketch", "tiny" or "egl"; "none" while the twin is not open."""
        return self._sensors.drawer if self._sensors is not None else "none"

    def open(self) -> None:
        """Build the scene. Raises `ConfigError` if EGL is asked for and this machine has none."""
        with self._sensor_lock:
            if self._sensors is None:
                self._sensors = Sensors(self._place[1], self.layout, self._renderer, self._seed)

    def close(self) -> None:
        """Stop, and let go of the scene. May be called twice."""
        with self._lock:
            self._body.command(STOP)
        with self._sensor_lock:
            if self._sensors is not None:
                self._sensors.close()
                self._sensors = None

    def now(self) -> float:
        """Simulated seconds since the twin was made."""
        if self._factor is None:
            return self._body.time_s
        return (time.monotonic() - self._began_s) * self._factor

    def wait(self, until_s: float) -> None:
        """Let simulated time pass until `until_s`."""
        if self._factor is not None:
            time.sleep(max(until_s - self.now(), 0.0) / self._factor)
            until_s = self.now()
        with self._lock:
            self._body.advance(until_s)

    def drive(self, command: Command) -> Applied:
        """Set the target of the base; what is not finite is refused and stops it."""
        with self._lock:
            self._body.advance(self.now())
            stamp_s = self._body.time_s
            applied = judge_command(command, self._profile.base, stamp_s)
            self._body.command(slipping(applied.twist, self._profile.base, self._place[1].base))
        return applied

    def read(self) -> Observation:
        """Capture every sensor whose period has passed, and return the newest of each."""
        with self._sensor_lock:
            if self._sensors is None:
                raise DeviceError("the twin is not open", "Call open() first.")
            with self._lock:
                self._body.advance(self.now())
                now_s, motion, odom = self._body.time_s, self._body.motion, self._body.measured()
            last = self._newest
            if last is not None and last.odom is not None and _periods(now_s) == _periods(last.odom.stamp_s):
                odom = last.odom
            newest = {**self._sensors.newest(motion, now_s), "odom": odom}
            observation = observation_of(self._seq + 1, now_s, newest)
            if last is None or self._has_stepped(last, now_s) or not same_readings(observation, last):
                self._seq += 1
                self._newest = last = observation
            return last

    def sense(self, field: str) -> Stamped:
        """Return the newest of one sensor, by its field of an observation, and measure no other.

        For looking ahead, see `foresight`. Raises `KeyError` for a sensor that this robot does not have.
        """
        with self._sensor_lock:
            if self._sensors is None:
                raise DeviceError("the twin is not open", "Call open() first.")
            with self._lock:
                self._body.advance(self.now())
                now_s, motion = self._body.time_s, self._body.motion
            reading: Stamped = self._sensors.read(NAMES[field], motion, now_s)
            return reading

    def reset(self, episode: Episode) -> None:
        """Put the robot down anew; a new layout only moves the boxes. Time goes on."""
        with self._sensor_lock, self._lock:
            self._body.advance(self.now())
            self._arrange(episode.layout)
            self._body.put_down(episode.start_m, episode.lateral_m, episode.yaw_rad, episode.began_m)
            self._forget()

    def place(self, layout: int, state: CourseState) -> None:
        """Put the robot into exactly this state. For looking ahead, see `foresight`."""
        with self._sensor_lock, self._lock:
            self._body.advance(self.now())
            self._arrange(layout)
            self._body.place(state)
            self._forget()

    def state(self) -> CourseState:
        """Ground truth now."""
        with self._lock:
            self._body.advance(self.now())
            return self._body.state()

    def _arrange(self, layout: int) -> None:
        if layout == self.layout.seed:
            return
        self._place = world, profile = surroundings(self.world, self._profile, layout)
        self._body.course = Course(build(world, layout), self._body.course.radius_m)
        if self._sensors is not None:
            self._sensors.arrange(self.layout, profile)

    def _has_stepped(self, last: Observation, now_s: float) -> bool:
        """Whether somebody let time pass: each step has an observation of its own, also one that saw nothing new."""
        return self._factor is None and now_s > last.stamp_s

    def _forget(self) -> None:
        self._newest = None
        if self._sensors is not None:
            self._sensors.forget()


def _periods(time_s: float) -> int:
    """How many periods of the odometry have begun: a reader that a picture held up does not slow it down."""
    return math.floor((time_s + ROUNDING_S) / ODOMETRY_PERIOD_S)


def slipping(told: Twist, base: Base, here: Base) -> Twist:
    """What becomes of a command to wheels that slip `here`: as much less as the robot's fastest is there."""
    return Twist(
        told.linear_m_s * here.max_linear_m_s / base.max_linear_m_s,
        told.angular_rad_s * here.max_angular_rad_s / base.max_angular_rad_s,
    )


def judge_command(command: Command, base: Base, stamp_s: float) -> Applied:
    """Clamp to the profile's limits; refuse what is not finite."""
    asked = command.twist
    age_s = stamp_s - command.stamp_s
    if not (math.isfinite(asked.linear_m_s) and math.isfinite(asked.angular_rad_s)):
        return Applied(STOP, stamp_s, Source.NONE, Reason.REFUSED, (), command.answers, age_s)
    twist = Twist(
        min(max(asked.linear_m_s, -base.max_linear_m_s), base.max_linear_m_s),
        min(max(asked.angular_rad_s, -base.max_angular_rad_s), base.max_angular_rad_s),
    )
    clamps = () if twist == asked else tuple(_clamped(asked, twist))
    return Applied(twist, stamp_s, command.source, Reason.OK, clamps, command.answers, age_s)


def _clamped(asked: Twist, got: Twist) -> Iterator[str]:
    """Which parts of a command were cut."""
    if got.linear_m_s != asked.linear_m_s:
        yield "linear"
    if got.angular_rad_s != asked.angular_rad_s:
        yield "angular"
