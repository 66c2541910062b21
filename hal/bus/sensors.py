"""The one table of sensors: where in an observation each stands, on which topic it travels, and who has it.

Whatever reads, publishes or listens to sensors goes by its rows; a driver hands over what it measures by their names.
One more sensor is a value with its ROS form (`hal.messages`), a row here, and a driver that measures it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, cast

from lira.hal.bus.topics import BATTERY, CAMERA, DEPTH, IMU, ODOM, RANGES, SCAN, Topic
from lira.hal.clock import is_fresh
from lira.hal.messages import CompressedImage, DepthImage, Image, Observation
from lira.hal.messages.compression import compress, compress_depth
from lira.hal.profile import RobotProfile


class Stamped(Protocol):
    """A message with a capture time."""

    @property
    def stamp_s(self) -> float:
        """Capture time on the robot's clock."""


def _always(profile: RobotProfile) -> bool:  # noqa: ARG001 - as every row asks
    return True


@dataclass(frozen=True, slots=True)
class Sensor:
    """One row. `field` is of `Observation`; `has` tells whether the robot of a profile has the sensor.

    `compress` makes a picture of its value: that is slow, so it is done in a thread of its own and only if somebody
    listens. `lasting`: what it measured holds on when a twin's episode ends. `many`: its field is a tuple, in which
    `name` is the value's frame.
    """

    name: str
    field: str
    topic: Topic[Any]
    has: Callable[[RobotProfile], bool] = _always
    compress: Callable[[Any, RobotProfile], CompressedImage] | None = None
    lasting: bool = False
    many: bool = False

    def value(self, observation: Observation) -> Stamped | None:
        """What this sensor measured, None if that is absent or stale."""
        value = getattr(observation, self.field)
        if self.many:
            return next((each for each in value if each.frame_id == self.name), None)
        return cast("Stamped | None", value)


def _picture(image: Image | CompressedImage, profile: RobotProfile) -> CompressedImage:
    return compress(image, profile.camera.encoding) if isinstance(image, Image) else image


def _depth(depth: DepthImage | CompressedImage, profile: RobotProfile) -> CompressedImage:  # noqa: ARG001
    return compress_depth(depth) if isinstance(depth, DepthImage) else depth


def _ranger(frame_id: str, topic: Topic[Any]) -> Sensor:
    def has(profile: RobotProfile) -> bool:
        return any(ranger.frame_id == frame_id for ranger in profile.ranger)

    return Sensor(frame_id, "ranges", topic, has, many=True)


SENSORS: tuple[Sensor, ...] = (
    Sensor("scan", "scan", SCAN),
    Sensor("camera", "image", CAMERA, compress=_picture),
    Sensor("depth", "depth", DEPTH, lambda profile: profile.depth is not None, compress=_depth),
    Sensor("odom", "odom", ODOM),
    Sensor("imu", "imu", IMU, lambda profile: profile.imu is not None),
    *(_ranger(frame_id, topic) for frame_id, topic in RANGES.items()),
    Sensor("battery", "battery", BATTERY, lambda profile: profile.battery is not None, lasting=True),
)


def sensors_of(profile: RobotProfile) -> tuple[Sensor, ...]:
    """The rows of those that a robot has."""
    return tuple(sensor for sensor in SENSORS if sensor.has(profile))


def listened_to(profile: RobotProfile) -> tuple[Sensor, ...]:
    """The rows that who is not at the robot itself listens to: of pictures only those that it has.

    What is small costs nothing where nobody sends it, and a robot may measure more than its profile says.
    """
    return tuple(sensor for sensor in SENSORS if sensor.compress is None or sensor.has(profile))


def observation_of(seq: int, now_s: float, newest: Mapping[str, Stamped | None]) -> Observation:
    """Put the newest values together, by the names of their sensors; what is stale at `now_s` is left out."""
    fields: dict[str, Any] = {}
    for sensor in SENSORS:
        value = newest.get(sensor.name)
        if value is None or not is_fresh(value.stamp_s, now_s, sensor.topic.max_age_s):
            continue
        fields[sensor.field] = (*fields.get(sensor.field, ()), value) if sensor.many else value
    return Observation(seq, now_s, **fields)


def same_readings(one: Observation, other: Observation) -> bool:
    """Whether two observations hold the very same readings."""
    return all(sensor.value(one) is sensor.value(other) for sensor in SENSORS)
