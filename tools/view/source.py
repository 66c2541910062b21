"""Where what viewers see comes from: the bus, heard only as far as somebody looks, or a recording."""

import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import Reader
from lira.hal.bus.topics import PICTURE, TOPICS, Topic

DEPTH = 64  # messages of a topic between two looks; of pictures the newest alone


@dataclass(frozen=True, slots=True)
class Sample:
    """One message: as it travelled (`payload`, CDR) and as a value; `time_ns` is when it was heard, in Unix time."""

    topic: Topic[Any]
    message: Any
    payload: bytes
    time_ns: int


class Source(Protocol):
    """What viewers look at. `topics` is all there is."""

    @property
    def topics(self) -> Sequence[Topic[Any]]:
        """What can be listened to."""

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""

    def listen(self, keys: Collection[str]) -> None:
        """Hear these topics from now on, and no others."""

    def poll(self) -> list[Sample]:
        """Return what came since the last time, oldest first within a topic."""


class LiveSource:
    """The bus now. What nobody looks at is not fetched from the robot, so a viewer costs the link what it shows."""

    topics: Sequence[Topic[Any]] = TOPICS
    ended = False

    def __init__(self, watch: Bus) -> None:
        self._watch = watch
        self._readers: dict[str, tuple[Topic[Any], Reader[Any]]] = {}

    def listen(self, keys: Collection[str]) -> None:
        """Hear these topics from now on, and no others."""
        for key in self._readers.keys() - set(keys):
            del self._readers[key]  # its subscription goes with it
        for topic in self.topics:
            if topic.key in keys and topic.key not in self._readers:
                depth = 1 if topic.qos == PICTURE else DEPTH
                self._readers[topic.key] = topic, self._watch.reader(topic, depth)

    def poll(self) -> list[Sample]:
        """Return what came since the last time, oldest first within a topic."""
        now_ns = time.time_ns()
        return [
            Sample(topic, each.message, each.payload, now_ns)
            for topic, reader in self._readers.values()
            for each in reader.poll()
        ]


class PlayedSource:
    """A recording, told at `speed` times its own pace (0: as fast as it can be read), from when somebody first looks.

    `recorded` are its samples in order; what was latched is told to whoever begins to look later, too.
    """

    topics: Sequence[Topic[Any]] = TOPICS
    AT_ONCE = 500  # samples between two looks, at whatever speed

    def __init__(self, recorded: Iterator[Sample], speed: float = 1.0) -> None:
        self._recorded, self._speed = recorded, speed
        self._next = next(recorded, None)
        self._keys: frozenset[str] = frozenset()
        self._began: tuple[int, int] | None = None  # of this machine's clock and of the recording's
        self._latched: dict[str, Sample] = {}
        self._due: list[Sample] = []

    @property
    def ended(self) -> bool:
        """Whether all was told."""
        return self._next is None and not self._due

    def listen(self, keys: Collection[str]) -> None:
        """Hear these topics from now on, and no others."""
        new, self._keys = set(keys) - self._keys, frozenset(keys)
        self._due += [self._latched[key] for key in sorted(new & self._latched.keys())]

    def poll(self) -> list[Sample]:
        """Return what was due since the last time."""
        found, self._due = self._due, []
        if not self._keys:
            return found
        until_ns = self._now_ns()
        while self._next is not None and self._next.time_ns <= until_ns and len(found) < self.AT_ONCE:
            each = self._next
            if each.topic.qos.latched:
                self._latched[each.topic.key] = each
            if each.topic.key in self._keys:
                found.append(each)
            self._next = next(self._recorded, None)
        return found

    def _now_ns(self) -> float:
        """Until when the recording is told."""
        if self._speed == 0.0 or self._next is None:
            return float("inf")
        if self._began is None:
            self._began = time.monotonic_ns(), self._next.time_ns
        return self._began[1] + round((time.monotonic_ns() - self._began[0]) * self._speed)
