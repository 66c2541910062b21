"""The CORE2 as its host sees it: what is learnt from its frames, and what it is to be told. No line, no clock."""

from dataclasses import dataclass, field
from typing import Any

from hal.errors import DeviceError, SensorError
from hal.messages import BatteryState, Imu, Odometry, Range
from robot.core2 import messages
from robot.core2.errands import Errands
from robot.core2.rosserial import Frame, Id, TopicInfo, encode_frame, encode_strings, encode_time, parse_topic_info
from robot.core2.wheels import Reckoner
from robot.settings import BaseSettings

# The board stamps with the time we gave it; what it says is believed if it is a plausible time before now.
OLDEST_STAMP_S = 0.25
FIRMWARE = "Flash the ROSbot firmware 0.14.3 to 0.16.2."


@dataclass(slots=True)
class Readings:
    """The newest of everything the board measures."""

    odom: Odometry | None = None
    imu: Imu | None = None
    battery: BatteryState | None = None
    ranges: dict[str, Range] = field(default_factory=dict)
    buttons: int = 0


class Board:
    """One session with the board. `handle` takes a frame and returns what has to be sent in answer."""

    def __init__(self, settings: BaseSettings) -> None:
        self._reckoner = Reckoner(settings)
        self.readings = Readings()
        self.unreadable = 0  # messages that did not decode
        self.answers: list[str] = []  # of the service `config`
        self.log: list[str] = []
        self._errands = Errands()
        self.forget()

    def forget(self) -> None:
        """The board starts anew: whatever it announced holds no more."""
        self._layouts: dict[int, tuple[str, str]] = {}
        self._velocity = (0.0, 0.0, 0.0)
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
        return not self.missing and self._config is not None

    def configure(self, command: str, data: str = "") -> None:
        """Have the board's service `config` called, until it answers; what it says comes into `answers`."""
        self._errands.want(command, data)

    def calls(self, now_s: float) -> bytes:
        """Return what has to be sent now for `configure`; nothing before the board is `ready`."""
        config = self._config
        if config is None:
            return b""
        return self._errands.due(now_s, lambda *texts: encode_frame(config, encode_strings(*texts)))

    def handle(self, frame: Frame, now_s: float) -> bytes:
        """Learn from a frame that came at `now_s`. Raises `DeviceError` for a board that speaks another language."""
        if frame.topic == Id.TIME:
            return encode_time(now_s)
        if frame.topic in (Id.PUBLISHER, Id.SUBSCRIBER, Id.SERVICE_ANSWERS, Id.SERVICE_REQUESTS):
            self._learn(Id(frame.topic), frame.payload)
        elif frame.topic == Id.LOG:
            self.log = [*self.log[-19:], frame.payload[5:].decode("utf-8", "replace")]
        elif frame.topic == self._config_answers:
            self.answers = [*self.answers[-19:], frame.payload[4:-1].decode("utf-8", "replace")]
            self._errands.answered()
        elif frame.topic in self._layouts:
            self._read(*self._layouts[frame.topic], frame.payload, now_s)
        return b""

    def _learn(self, way: Id, payload: bytes) -> None:
        try:
            info = parse_topic_info(payload)
        except ValueError:
            self.unreadable += 1
            return
        if way is Id.SERVICE_REQUESTS and info.name == "config":
            check_md5(info, messages.CONFIG_REQUEST_MD5)
            self._config = info.topic
        elif way is Id.SERVICE_ANSWERS and info.name == "config":
            check_md5(info, messages.CONFIG_ANSWER_MD5)
            self._config_answers = info.topic
        elif messages.is_known(info.name):
            layout = messages.layout_of(info.name, info.md5)
            if layout is None:
                raise wrong_layout(info)
            if way is Id.SUBSCRIBER and info.name == "cmd_vel":
                self.cmd_vel = info.topic
            elif way is Id.PUBLISHER:
                self._layouts[info.topic] = (info.name, layout)

    def _read(self, topic: str, layout: str, payload: bytes, now_s: float) -> None:
        try:
            message = messages.decode(layout, payload)
        except SensorError:
            self.unreadable += 1
            return
        readings = self.readings
        if topic == "velocity":
            self._velocity = (message.linear.x, message.linear.y, message.angular.z)
        elif topic == "pose":
            readings.odom = self._reckoner.step(messages.pose_of(message), self._velocity, stamp_of(message, now_s))
        elif topic == "imu":
            readings.imu = messages.imu_of(message, stamp_of(message, now_s))
        elif topic == "battery":
            readings.battery = messages.battery_of(message, stamp_of(message, now_s))
        elif topic == "buttons":
            readings.buttons = message.data
        else:
            reading = messages.range_of(message, topic, stamp_of(message, now_s))
            readings.ranges[reading.frame_id] = reading


def stamp_of(message: Any, now_s: float) -> float:
    """When a message was captured, on our clock: as it says, unless its clock is not ours yet."""
    stamp_s = float(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)
    return stamp_s if now_s - OLDEST_STAMP_S <= stamp_s <= now_s else now_s


def check_md5(info: TopicInfo, md5: str) -> None:
    """Raise `DeviceError` for a topic whose layout is not ours."""
    if info.md5 != md5:
        raise wrong_layout(info)


def wrong_layout(info: TopicInfo) -> DeviceError:
    """What to say about a topic of another layout."""
    return DeviceError(f"the base board's '{info.name}' ({info.kind}) has an unknown layout, MD5 {info.md5}", FIRMWARE)
