"""What a HAL server sends: everything in the table of sensors, when it is new; pictures compressed."""

from typing import Any, cast

from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.sensors import SENSORS, Sensor, Stamped
from lira.hal.bus.topics import IN_LOCKSTEP
from lira.hal.description.drift import Drift
from lira.hal.messages import CameraInfo, Observation, Odometry
from lira.hal.profile import RobotProfile
from lira.hal.server.graph_publisher import GraphPublisher, Picture


class SensorPublisher:
    """Publishes the parts of observations. With `lockstep` all of them each time, else only those that are new.

    Pictures are left to the caller: they are slow, and may be sent from a thread of their own. With each odometry goes
    where the body is, with each picture what its camera projects; `describe` tells what stays as it is, once.
    `calibration` is the camera's, None for the profile's pinhole.
    """

    def __init__(
        self, bus: Bus, profile: RobotProfile, calibration: CameraInfo | None = None, *, lockstep: bool
    ) -> None:
        self._boundary = bus.boundary
        self._profile = profile
        self._lockstep = lockstep
        self._sent_s: dict[str, float] = {}
        qos = IN_LOCKSTEP if lockstep else None
        self._graph = GraphPublisher(bus, profile, calibration, lockstep=lockstep)
        self._drift = Drift(profile.base)
        self._publishers: dict[str, Publisher[Any]] = {each.name: bus.publisher(each.topic, qos) for each in SENSORS}

    def describe(self, now_s: float, *, arena: bool) -> None:
        """Publish how the robot is built, for all who ever come, and make known what there is, of an `arena`, too."""
        self._graph.announce(arena=arena)
        self._graph.describe(now_s)

    def put(self, observation: Observation, now_s: float) -> None:
        """Publish everything but the pictures."""
        for sensor in SENSORS:
            if sensor.compress is None:
                self._put(sensor, observation, now_s)

    def put_pictures(self, observation: Observation, now_s: float) -> None:
        """Publish the pictures, compressed as the profile says: in lockstep all, else those that somebody wants."""
        for sensor in SENSORS:
            value = sensor.value(observation)
            if sensor.compress is None or value is None:
                continue
            if self._lockstep or self._publishers[sensor.name].matching:
                self._put(sensor, observation, now_s)
            self._graph.put_info(sensor.name, cast("Picture", value), now_s)  # somebody may listen to that alone

    def _put(self, sensor: Sensor, observation: Observation, now_s: float) -> None:
        value = sensor.value(observation)
        if value is None or not (self._lockstep or self._is_new(sensor, value)):
            return
        self._sent_s[sensor.name] = value.stamp_s
        with self._boundary.guard(sensor.topic.key):
            if sensor.compress is not None:
                picture = sensor.compress(value, self._profile)
                self._publishers[sensor.name].put(picture, now_s, seq=observation.seq)
                self._graph.put_info(sensor.name, picture, now_s)
                return
            message = self._drift.note(value) if isinstance(value, Odometry) else value
            self._publishers[sensor.name].put(message, now_s, seq=observation.seq)
            if isinstance(value, Odometry):
                self._graph.put_odometry(value, now_s)

    def _is_new(self, sensor: Sensor, value: Stamped) -> bool:
        return self._sent_s.get(sensor.name) != value.stamp_s
