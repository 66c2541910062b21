"""One topic as somebody hears it: the newest of it, and how often it came of late."""

from collections import deque
from typing import Generic, TypeVar

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import Topic
from lira.tools.lifecycle.records import TopicState

M = TypeVar("M")
WINDOW_S = 3.0
DEPTH = 64  # between two looks


class Rate:
    """How often something comes, over the last seconds. Pure; times come in."""

    def __init__(self) -> None:
        self._arrived: deque[float] = deque()

    def note(self, arrived_s: float) -> None:
        """It came."""
        self._arrived.append(arrived_s)

    def hz(self, now_s: float) -> float:
        """How often it came of late."""
        while self._arrived and self._arrived[0] <= now_s - WINDOW_S:
            self._arrived.popleft()
        return len(self._arrived) / WINDOW_S


class Line(Generic[M]):
    """Listens to one topic, which comes `usual_hz` times a second, or as often as the table says.

    `newest` is None, and `arrived_s` minus infinity, until it came.
    """

    def __init__(self, bus: Bus, topic: Topic[M], usual_hz: float | None = None) -> None:
        self._key, self._usual_hz = topic.key, usual_hz or topic.rate_hz
        self._reader = bus.reader(topic, DEPTH)
        self._rate = Rate()
        self.newest: M | None = None
        self.arrived_s = float("-inf")

    def listen(self) -> None:
        """Take in what came."""
        for received in self._reader.poll():
            self._rate.note(received.arrived_s)
            self.newest, self.arrived_s = received.message, received.arrived_s

    def state(self, now_s: float) -> TopicState:
        """What is told about it."""
        age_s = None if self.newest is None else round(now_s - self.arrived_s, 3)
        return TopicState(self._key, round(self._rate.hz(now_s), 1), self._usual_hz, age_s)
