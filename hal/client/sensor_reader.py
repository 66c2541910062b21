"""A client's readers of everything a robot publishes, and the observation they add up to."""

from typing import Any, Generic, TypeVar

from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import Received
from lira.hal.bus.sensors import Stamped, listened_to, observation_of
from lira.hal.bus.topics import Topic
from lira.hal.clock import AHEAD_S, is_fresh
from lira.hal.messages import Observation
from lira.hal.profile import RobotProfile

S = TypeVar("S", bound=Stamped)


class Sense(Generic[S]):
    """One topic: its newest value, or None once that is stale by the table."""

    def __init__(self, bus: Bus, topic: Topic[S]) -> None:
        self._max_age_s = topic.max_age_s
        self._reader = bus.reader(topic)
        self._not_before_s = float("-inf")
        self._judged: Received[S] | None = None  # the newest, and whether it came with an honest stamp
        self._honest = False
        self._epoch: int | None = None  # of the start that counts; any if None
        self.seq = -1  # the observation that the newest value belongs to

    def forget(self, before_s: float) -> None:
        """Return nothing any more that was captured before that time."""
        self._not_before_s = before_s

    def restart(self, epoch: int) -> None:
        """Return nothing any more but what comes from this start of the robot, whose clock is another one."""
        self._not_before_s, self._epoch, self.seq = float("-inf"), epoch, -1

    def read(self, now_s: float) -> S | None:
        """Return the newest value if it is fresh at `now_s` on the robot's clock."""
        newest = self._reader.newest()
        if newest is None or newest.message.stamp_s < self._not_before_s:
            return None
        attachment = newest.attachment
        if attachment is not None and self._epoch not in (None, attachment.epoch):
            return None
        if newest is not self._judged:
            # One from ahead does not become fresh by waiting.
            self._judged, self._honest = newest, newest.message.stamp_s <= now_s + AHEAD_S
        if not self._honest or not is_fresh(newest.message.stamp_s, now_s, self._max_age_s):
            return None
        if attachment is not None:
            self.seq = attachment.seq
        return newest.message


class SensorReader:
    """All sensors of the robot of a profile."""

    def __init__(self, bus: Bus, profile: RobotProfile) -> None:
        self._senses = [(sensor, Sense[Any](bus, sensor.topic)) for sensor in listened_to(profile)]

    def forget(self, before_s: float) -> None:
        """Return nothing any more that was captured before that time, but for what outlives an episode."""
        for sensor, sense in self._senses:
            if not sensor.lasting:
                sense.forget(before_s)

    def restart(self, epoch: int) -> None:
        """Return nothing any more but what comes from this start of the robot, whose clock is another one."""
        for _, sense in self._senses:
            sense.restart(epoch)

    def observe(self, now_s: float, seq: int | None = None) -> Observation:
        """Put the fresh ones together. Without a `seq` it is the newest that came with any of them."""
        newest = {sensor.name: sense.read(now_s) for sensor, sense in self._senses}
        if seq is None:
            seq = max(0, *(sense.seq for _, sense in self._senses))
        return observation_of(seq, now_s, newest)

    def has_again(self, before: Observation, after: Observation) -> bool:
        """Whether every sensor that measured something before an episode ended does so in the new one."""
        episodic = [sensor for sensor, _ in self._senses if not sensor.lasting]
        return all(sensor.value(after) is not None for sensor in episodic if sensor.value(before) is not None)
