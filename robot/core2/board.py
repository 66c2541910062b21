"""The CORE2 as its host sees it: what is learnt from its frames, and what it is to be told. No line, no clock."""

import math
from dataclasses import dataclass, field
from typing import Any

from lira.hal.errors import DeviceError, SensorError
from lira.hal.messages import BatteryState, Imu, Odometry, Range
from lira.robot.core2 import messages
from lira.robot.core2.config_calls import Errands
from lira.robot.core2.rosserial import (
    Frame,
    Id,
    TopicInfo,
    encode_frame,
    encode_strings,
    encode_time,
    parse_answer,
    parse_topic_info,
)
from lira.robot.core2.stamps import Stamps
from lira.robot.core2.wheels import Reckoner
from lira.robot.settings import BaseSettings

CONFIG_MD5S = {
    Id.SERVICE_REQUESTS: messages.CONFIG_REQUEST_MD5,
    Id.SERVICE_ANSWERS: messages.CONFIG_ANSWER_MD5,
}
FIRMWARE = "Flash the ROSbot firmware 0.14.3 to 0.16.2."
ASK_KINEMATICS, DIFFERENTIAL, MECANUM = "GKIN", "DIFF", "MEC"
BANNER = "firmware"
UNKNOWN = 2  # result of a call that the firmware has no word for


@dataclass(slots=True)
class Readings:
    """The newest of everything the board measures."""

    odom: Odometry | None = None
    imu: Imu | None = None
    battery: BatteryState | None = None
    ranges: dict[str, Range] = field(default_factory=dict)
    buttons: int = 0

    def by_name(self) -> dict[str, Odometry | Imu | BatteryState | Range | None]:
        """Those that are part of an observation, by the names in the table of sensors."""
        return {"odom": self.odom, "imu": self.imu, "battery": self.battery, **self.ranges.copy()}


class Board:
    """One session with the board. `handle` takes its frames, `calls` gives what it has to be sent."""

    def __init__(self, settings: BaseSettings) -> None:
        self._reckoner = Reckoner(settings)
        self._stamps = Stamps()
        self.readings = Readings()
        self.read = self.announced = 0  # messages on topics that it announced, and announcements
        self.unreadable = 0  # messages that did not decode
        self.answers: list[str] = []  # of the service `config`
        self.log: list[str] = []
        self._errands = Errands()
        self.forget()

    def forget(self) -> None:
        """The board starts anew: whatever it announced holds no more."""
        self._layouts: dict[int, tuple[str, str]] = {}
        self._refused: dict[str, TopicInfo] = {}
        self._asked_time_s: float | None = None
        self._velocity = (0.0, 0.0, 0.0)
        self.kinematics: str | None = None  # "DIFF" or "MEC", once it has said so
        self._stamps.forget()
        self.cmd_vel: int | None = None
        self._config: int | None = None
        self._config_answers: int | None = None
        self._errands.forget()
        self._reckoner.rebase()

    @property
    def missing(self) -> list[str]:
        """Needed topics that the board has not announced."""
        announced = {topic for topic, _ in self._layouts.values()}
        found = announced | ({"cmd_vel"} if self.cmd_vel is not None else set())
        return [topic for topic in messages.NEEDED if topic not in found]

    @property
    def ready(self) -> bool:
        """Whether it can be driven and configured."""
        return not (self.missing or self._refused or self._config is None or self._config_answers is None)

    @property
    def has_announced(self) -> bool:
        """Whether it has told of anything since it was forgotten."""
        return bool(self._layouts or self._refused) or self.cmd_vel is not None

    def objection(self) -> DeviceError:
        """Why it is not ready."""
        if self._refused:
            return wrong_layout(next(iter(self._refused.values())))
        return DeviceError(f"the base board lacks {', '.join(self.missing) or 'config'}", FIRMWARE)

    @property
    def banner(self) -> str:
        """What its firmware said of itself, in one line; "" if that was not heard."""
        told = next((text for text in reversed(self.log) if BANNER in text.lower()), "")
        return " ".join("".join(each if each.isprintable() else " " for each in told).split())[:80]

    def configure(self, command: str, data: str = "") -> None:
        """Have the board's service `config` called, until it answers; what it says comes into `answers`."""
        self._errands.want(command, data)

    def forget_calls(self) -> None:
        """Nothing is to be called any more."""
        self._errands.forget()

    def unanswered_s(self, now_s: float) -> float:
        """For how long a call has been repeated without an answer."""
        return self._errands.unanswered_s(now_s)

    def calls(self, now_s: float) -> bytes:
        """Return what has to be sent now for `configure`, and the time if it asked; nothing before it is `ready`."""
        config = self._config
        if config is None or not self.ready:
            return b""
        asked_s, self._asked_time_s = self._asked_time_s, None
        time = b"" if asked_s is None else encode_time(asked_s)
        if time:
            self._stamps.told(now_s)
        return time + self._errands.due(now_s, lambda *texts: encode_frame(config, encode_strings(*texts)))

    def handle(self, frame: Frame, now_s: float) -> None:
        """Learn from a frame that came at `now_s`. What cannot be read is counted."""
        if frame.topic == Id.TIME:
            self._asked_time_s = now_s  # the board adds how long the answer was under way
        elif frame.topic in (Id.PUBLISHER, Id.SUBSCRIBER, Id.SERVICE_ANSWERS, Id.SERVICE_REQUESTS):
            self._learn(Id(frame.topic), frame.payload)
        elif frame.topic == Id.LOG:
            self.log = [*self.log[-19:], frame.payload[5:].decode("utf-8", "replace")]
        elif frame.topic == self._config_answers:
            self._hear_answer(frame.payload)
        elif frame.topic in self._layouts:
            self.read += 1
            self._read(*self._layouts[frame.topic], frame.payload, now_s)

    def _hear_answer(self, payload: bytes) -> None:
        try:
            data, result = parse_answer(payload)
        except ValueError:
            self.unreadable += 1
            return
        self.answers = [*self.answers[-19:], data]
        if self._errands.answered() == ASK_KINEMATICS:
            if data in (DIFFERENTIAL, MECANUM):
                self.kinematics = data
            elif result == UNKNOWN:
                self.kinematics = DIFFERENTIAL  # firmware that knows no other

    def _learn(self, way: Id, payload: bytes) -> None:
        try:
            info = parse_topic_info(payload)
        except ValueError:
            self.unreadable += 1
            return
        self.announced += 1
        if way in (Id.SERVICE_REQUESTS, Id.SERVICE_ANSWERS):
            if info.name == "config" and self._accept(info, info.md5 == CONFIG_MD5S[way]):
                if way is Id.SERVICE_REQUESTS:
                    self._config = info.topic
                else:
                    self._config_answers = info.topic
        elif messages.is_known(info.name):
            layout = messages.layout_of(info.name, info.md5)
            if not self._accept(info, layout is not None) or layout is None:
                return
            if way is Id.SUBSCRIBER and info.name == "cmd_vel":
                self.cmd_vel = info.topic
            elif way is Id.PUBLISHER:
                others = {topic: told for topic, told in self._layouts.items() if told[0] != info.name}
                self._layouts = {**others, info.topic: (info.name, layout)}

    def _accept(self, info: TopicInfo, right: bool) -> bool:
        """Note whether a topic's layout is ours; it may be told anew, rightly, if the line has spoilt it."""
        if right:
            self._refused.pop(info.name, None)
        else:
            self._refused[info.name] = info
        return right

    def _read(self, topic: str, layout: str, payload: bytes, now_s: float) -> None:
        try:
            self._take(topic, messages.decode(layout, payload), now_s)
        except SensorError:
            self.unreadable += 1

    def _take(self, topic: str, message: Any, now_s: float) -> None:
        """Keep a reading. Raises `SensorError` for one that is not finite: it would never leave the odometry again."""
        readings = self.readings
        if topic == "velocity":
            velocity = (message.linear.x, message.linear.y, message.angular.z)
            finite(*velocity)
            self._velocity = velocity
        elif topic == "pose":
            pose = messages.pose_of(message)
            finite(pose.x_m, pose.y_m, pose.yaw_rad)
            in_body = self.kinematics == MECANUM
            odom = self._reckoner.step(pose, self._velocity, self._stamp(topic, message, now_s), in_body=in_body)
            finite(odom.linear_m_s, odom.angular_rad_s)
            readings.odom = odom
        elif topic == "imu":
            imu = messages.imu_of(message, self._stamp(topic, message, now_s))
            finite(imu.yaw_rad, imu.angular_rad_s, imu.linear_m_s2, imu.lateral_m_s2)
            readings.imu = imu
        elif topic == "battery":
            battery = messages.battery_of(message, self._stamp(topic, message, now_s))
            finite(battery.voltage_v)
            readings.battery = battery
        elif topic == "buttons":
            readings.buttons = message.data
        else:
            reading = messages.range_of(message, topic, self._stamp(topic, message, now_s))
            readings.ranges[reading.frame_id] = reading

    def _stamp(self, topic: str, message: Any, now_s: float) -> float:
        said = message.header.stamp
        return self._stamps.of(topic, float(said.sec + said.nanosec * 1e-9), now_s)


def finite(*values: float) -> None:
    """Raise `SensorError` if one of the values is not finite."""
    if not all(map(math.isfinite, values)):
        raise SensorError(f"the board measured {values}")


def wrong_layout(info: TopicInfo) -> DeviceError:
    """What to say about a topic of another layout."""
    return DeviceError(f"the base board's '{info.name}' ({info.kind}) has an unknown layout, MD5 {info.md5}", FIRMWARE)
