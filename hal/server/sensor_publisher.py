"""What a HAL server sends: everything in the table of sensors, when it is new; pictures compressed."""

from typing import Any

from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.sensors import SENSORS, Sensor, Stamped
from lira.hal.bus.topics import IN_LOCKSTEP
from lira.hal.messages import Observation
from lira.hal.profile import RobotProfile


class SensorPublisher:
    """Publishes the parts of observations. With `lockstep` all of them each time, else only those that are new.

    Pictures are left to the caller: they are slow, and may be sent from a thread of their own.
    """

    def __init__(self, bus: Bus, profile: RobotProfile, *, lockstep: bool) -> None:
        self._boundary = bus.boundary
        self._profile = profile
        self._lockstep = lockstep
        self._sent_s: dict[str, float] = {}
        qos = IN_LOCKSTEP if lockstep else None
        self._publishers: dict[str, Publisher[Any]] = {each.name: bus.publisher(each.topic, qos) for each in SENSORS}

    def put(self, observation: Observation, now_s: float) -> None:
        """Publish everything but the pictures."""
        for sensor in SENSORS:
            if sensor.compress is None:
                self._put(sensor, observation, now_s)

    def put_pictures(self, observation: Observation, now_s: float) -> None:
        """Publish the pictures, compressed as the profile says: in lockstep all, else those that somebody wants."""
        for sensor in SENSORS:
            if sensor.compress is not None and (self._lockstep or self._publishers[sensor.name].matching):
                self._put(sensor, observation, now_s)

    def _put(self, sensor: Sensor, observation: Observation, now_s: float) -> None:
        value = sensor.value(observation)
        if value is None or not (self._lockstep or self._is_new(sensor, value)):
            return
        self._sent_s[sensor.name] = value.stamp_s
        with self._boundary.guard(sensor.topic.key):
            message = value if sensor.compress is None else sensor.compress(value, self._profile)
            self._publishers[sensor.name].put(message, now_s, seq=observation.seq)

    def _is_new(self, sensor: Sensor, value: Stamped) -> bool:
        return self._sent_s.get(sensor.name) != value.stamp_s
