"""A client's readers of everything a robot publishes, and the observation they add up to."""

from typing import Any, Generic, Protocol, TypeVar

from lira.hal.bus.bus import Bus, Received
from lira.hal.bus.topics import BATTERY, CAMERA, IMU, ODOM, RANGES, SCAN, Topic
from lira.hal.clock import AHEAD_S, is_fresh
from lira.hal.messages import Observation


class Stamped(Protocol):
    """A message with a capture time."""

    @property
    def stamp_s(self) -> float:
        """Capture time on the robot's clock."""


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
        self._not_before_s, self._epoch = float("-inf"), epoch

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


class Senses:
    """All sensors of a robot."""

    def __init__(self, bus: Bus) -> None:
        self._scan = Sense(bus, SCAN)
        self._image = Sense(bus, CAMERA)
        self._odom = Sense(bus, ODOM)
        self._imu = Sense(bus, IMU)
        self._battery = Sense(bus, BATTERY)
        self._ranges = [Sense(bus, topic) for topic in RANGES.values()]

    def forget(self, before_s: float) -> None:
        """Return nothing any more that was captured before that time. A battery outlives an episode."""
        for sense in self._episodic():
            sense.forget(before_s)

    def _episodic(self) -> list[Sense[Any]]:
        return [self._scan, self._image, self._odom, self._imu, *self._ranges]

    def restart(self, epoch: int) -> None:
        """Return nothing any more but what comes from this start of the robot, whose clock is another one."""
        for sense in (*self._episodic(), self._battery):
            sense.restart(epoch)

    def observe(self, now_s: float, seq: int | None = None) -> Observation:
        """Put the fresh ones together. Without a `seq` it is the newest that came with any of them."""
        scan, image, odom = self._scan.read(now_s), self._image.read(now_s), self._odom.read(now_s)
        imu, battery = self._imu.read(now_s), self._battery.read(now_s)
        ranges = tuple(value for sense in self._ranges if (value := sense.read(now_s)) is not None)
        if seq is None:
            seq = max(self._scan.seq, self._image.seq, self._odom.seq, self._imu.seq, 0)
        return Observation(seq, now_s, scan, image, odom, imu, battery, ranges)
