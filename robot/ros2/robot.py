"""A robot that runs ROS 2 as a `hal.port.Robot`: its topics are read and written as ROS 2 has them.

How its messages come and go is `transport.py`'s: behind zenoh-bridge-ros2dds, or in a graph of rmw_zenoh.
"""

import math
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from lira.hal.bus.publisher import Publisher
from lira.hal.bus.reader import Reader
from lira.hal.bus.sensors import SENSORS, listened_to, observation_of, sensors_of
from lira.hal.bus.topics import CMD_VEL, SENSOR, Topic
from lira.hal.clock import ClockEstimate, is_fresh
from lira.hal.errors import BusError, ConfigError, DeviceError
from lira.hal.messages import STOP, Applied, Command, Observation, Reason, Source, Twist, TwistStamped
from lira.hal.port import DeviceHealth
from lira.hal.profile import RobotProfile
from lira.robot.ros2.forms import placed_scan, plain_picture
from lira.robot.ros2.transport import BRIDGE, Form, Transport

SENSED: dict[str, Topic[Any]] = {sensor.name: sensor.topic for sensor in SENSORS}
NEEDED = {"scan": "lidar", "camera": "camera"}
CLOCKS = ("scan", "odom", "imu")  # stamped by the robot's computer; a camera may have a clock of its own
COMMANDED = "cmd_vel"
BLIND_S = 0.5  # driven on nothing older than this
OPEN_S = 10.0
LOOK_S = 0.0005
SEND_S = 0.05
STOOD_S = 0.1  # nobody here waits so long before it looks at the time again
FAREWELL = 3
HAND_S = 0.3  # longer than a multiplexer takes the hand's last word for its command
USEFUL = ("odom", "imu", "battery")


@dataclass(frozen=True, slots=True)
class Interface:
    """How the robot's ROS 2 names and types differ from ours, and how its lidar is mounted.

    `topics` gives another topic to cmd_vel or a sensor (scan, camera, ... of `hal.bus.sensors`); `stamped`: it wants
    TwistStamped. `manual` is a topic that its multiplexer puts before all others, "" without one: the hand and the
    emergency stop go there.
    """

    topics: Mapping[str, str] = field(default_factory=dict)
    stamped: bool = False
    lidar_yaw_rad: float = 0.0
    manual: str = ""

    def __post_init__(self) -> None:
        """Raise `ConfigError` for a name that is none of ours."""
        for name in self.topics.keys() - {*SENSED, COMMANDED}:
            raise ConfigError(f"'{name}' is no topic that can be named", f"Choose of {', '.join(SENSED)}, {COMMANDED}.")

    def topic(self, name: str) -> Topic[Any]:
        """A topic of ours by the robot's name for it; ROS 2 keeps no latched value for us."""
        ours: Topic[Any] = CMD_VEL if name == COMMANDED else SENSED[name]
        kind = TwistStamped if name == COMMANDED and self.stamped else ours.kind
        qos = SENSOR if ours.qos.latched else ours.qos
        return replace(ours, key=self.topics.get(name, ours.key).strip("/"), kind=kind, qos=qos)

    @property
    def first(self) -> Topic[Any] | None:
        """The topic that goes before all others, None without one."""
        return replace(self.topic(COMMANDED), key=self.manual.strip("/")) if self.manual else None


class Ros2Robot:
    """Implements `hal.port.Robot`, `SensorEvents`, `DeviceMonitor` and `MotorSwitch`. Its clock is the ROS clock there.

    Everything that makes it safe happens on this side. `Applied` says what was sent: what the robot's own stack makes
    of it, nobody here knows. Its "lidar" or "camera" is lost while no new scan or picture comes. Where its multiplexer
    has a topic that goes first, the hand drives there, and while the emergency stop holds, zeros are sent there: on any
    other somebody else may go before. Left alone that topic lets others drive again.
    """

    def __init__(self, profile: RobotProfile, far: Transport, interface: Interface, form: Form = BRIDGE) -> None:
        self._profile = profile
        self._far = far
        self._form = form
        self._interface = interface
        self._readers: dict[str, Reader[Any]] = {
            sensor.name: far.reader(interface.topic(sensor.name)) for sensor in listened_to(profile)
        }
        self._wheels: Publisher[Any] = far.publisher(interface.topic(COMMANDED))
        first = interface.first
        self._first: Publisher[Any] | None = None if first is None else far.publisher(first)
        self._cut = False  # by the emergency stop
        self._hand_s = -math.inf  # when the hand drove last, by our own clock
        self._newest: dict[str, Any] = {}
        self._open = False
        self._seq = 0
        self._heard = False  # something came that `read` has not returned yet
        self._lock = threading.Lock()  # over the clock and what is sent
        self._clock = ClockEstimate(even=True)
        self._silences = 0  # how often a topic that is needed was silent, and came back
        self._sent, self._sent_s = STOP, 0.0
        self._told = 0.0, math.inf  # what the time was last, and when by our own clock

    @property
    def profile(self) -> RobotProfile:
        """The robot's profile: nobody there tells one."""
        return self._profile

    def open(self) -> None:
        """Wait until the robot shows what it must. Raises `DeviceError` that names what it does not, `BusError`."""
        until_s = time.monotonic() + OPEN_S
        while (lost := self._silent()) and time.monotonic() < until_s:
            self._listen()
            time.sleep(LOOK_S)
        if lost and self._far.peers() == 0:
            what = f"no {self._form.nobody} answers at {self._far.endpoint}"
            raise BusError(what, f"Does {self._form.program} run there, and is the address right?")
        for name in lost:
            key = self._interface.topic(name).key
            stamp = getattr(self._newest.get(name), "stamp_s", None)
            what = f"nothing comes on '{key}'" if stamp is None else f"what comes on '{key}' is stamped {stamp:.1f} s"
            raise DeviceError(
                what, self._form.silent if stamp is None else "Its driver has to stamp with the robot's own clock."
            )
        self._open = True

    def read(self) -> Observation:
        """Return the newest of every sensor; what is older than its topic allows is None."""
        if not self._open:
            raise DeviceError("the robot is not open", "Call open() first.")
        news = self._listen() or self._heard
        self._heard = False
        if self._seq == 0 or news:
            self._seq += 1
        return observation_of(self._seq, self.now(), self._newest)

    def drive(self, command: Command) -> Applied:
        """Send a velocity, at once if it is new, else at 20 Hz; zero if it was decided too long ago by now."""
        twist, reason = command.twist, Reason.OK
        with self._lock:
            now_s = self._now()  # not before: whoever waited for the lock would take an old command for a new one
            if now_s - command.stamp_s > self._profile.control.robot_timeout_s:
                twist, reason = STOP, Reason.STALE
            if command.source is Source.TELEOP:
                self._hand_s = time.monotonic()
            due = twist != self._sent or time.monotonic() - self._sent_s >= SEND_S
            if due:
                self._send(twist, now_s)
        return Applied(twist, now_s, command.source, reason, (), command.answers, now_s - command.stamp_s)

    def cut_motors(self, off: bool) -> None:
        """Hold the robot by the topic that goes first, where there is one, or let go of it; with the next `drive`."""
        self._cut = off
        self._sent_s = -math.inf

    def device_health(self) -> DeviceHealth:
        """Which of scan and picture are silent now, and how often either was."""
        lost = tuple(NEEDED[name] for name in self._silent())
        return DeviceHealth(lost, self._silences)

    def now(self) -> float:
        """Seconds on the robot's ROS clock, late by the shortest way of a message; 0 before there was any."""
        with self._lock:
            return self._now()

    def wait(self, until_s: float) -> None:
        """Sleep."""
        time.sleep(max(until_s - self.now(), 0.0))

    def wait_news(self, until_s: float) -> None:
        """Sleep until something came, for `read` to return."""
        while not self._heard and (left_s := until_s - self.now()) > 0.0:
            time.sleep(min(left_s, LOOK_S))
            self._heard = self._listen()

    def close(self) -> None:
        """Send zero. May be called twice."""
        self._open = False
        with self._lock:
            for _ in range(FAREWELL):
                try:
                    self._send(STOP, self._now())
                except BusError:
                    return

    def troubles(self) -> dict[str, str]:
        """What is missing, each with its remedy."""
        return {name: f"'{self._interface.topic(name).key}' is silent. {self._form.silent}" for name in self._silent()}

    def missing(self) -> dict[str, str]:
        """Topics of sensors that it can do without, from which nothing ever came, by the sensors' names."""
        wanted = [each.name for each in sensors_of(self._profile) if each.name in USEFUL]
        return {name: self._interface.topic(name).key for name in wanted if name not in self._newest}

    def _now(self) -> float:
        """The robot's time. If this process stood still it counts that itself: what comes first is of before, and by
        that no time would have passed.
        """
        if not self._clock.known:
            return 0.0
        local_s, (told_s, told_at_s) = time.monotonic(), self._told
        gap_s = local_s - told_at_s
        self._told = max(self._clock.now(local_s), told_s + gap_s if gap_s > STOOD_S else told_s), local_s
        return self._told[0]

    def _send(self, twist: Twist, now_s: float) -> None:
        """A hand that has just let go says zero on its topic, too."""
        self._sent, self._sent_s = twist, time.monotonic()
        by_hand = self._sent_s - self._hand_s < HAND_S
        message = TwistStamped(now_s, twist) if self._interface.stamped else twist
        if self._first is not None and (by_hand or self._cut):
            self._first.put(message, now_s)
            message = TwistStamped(now_s, STOP) if self._interface.stamped else STOP
        self._wheels.put(message, now_s)

    def _listen(self) -> bool:
        """Take what came; returns whether anything did."""
        news = False
        for name, reader in self._readers.items():
            for received in reader.poll():
                news = True
                with self._far.boundary.guard(name):
                    value = received.message
                    if name in CLOCKS:
                        with self._lock:
                            self._clock.note(value.stamp_s, received.arrived_s)
                    if name == "scan":
                        value = placed_scan(value, self._interface.lidar_yaw_rad)
                    elif name == "camera":
                        value = plain_picture(value)
                    self._take(name, value)
        return news

    def _take(self, name: str, value: Any) -> None:
        """Keep what came. Our estimate of the robot's clock lags: nothing was captured later than now."""
        now_s = self.now()
        if now_s < value.stamp_s <= now_s + BLIND_S:  # if further ahead, it is stamped by another clock
            value = replace(value, stamp_s=now_s)
        if name in NEEDED and name in self._newest:
            self._silences += name in self._silent()
        self._newest[name] = value

    def _silent(self) -> list[str]:
        now_s = self.now()
        known = ((name, self._newest.get(name)) for name in NEEDED)
        return [name for name, value in known if value is None or not is_fresh(value.stamp_s, now_s, BLIND_S)]
