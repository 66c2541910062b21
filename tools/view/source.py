"""Where what viewers see comes from: the bus, heard only as far as somebody looks."""

import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import Reader
from lira.hal.bus.topics import PICTURE, TOPICS, Topic

DEPTH = 64  # messages of a topic between two looks; of pictures the newest alone


@dataclass(frozen=True, slots=True)
class Sample:
    """One message: as it travelled (`payload`, CDR) and as a value.

    `time_ns` is when it was heard, in Unix time. `sent_s` is when it was sent, on the robot's clock, None where its
    sender does not say.
    """

    topic: Topic[Any]
    message: Any
    payload: bytes
    time_ns: int
    sent_s: float | None


class Source(Protocol):
    """What viewers look at. `topics` is all there is."""

    @property
    def topics(self) -> Sequence[Topic[Any]]:
        """What can be listened to."""

    def listen(self, keys: Collection[str]) -> None:
        """Hear these topics from now on, and no others."""

    def poll(self) -> list[Sample]:
        """Return what came since the last time, oldest first within a topic."""


class LiveSource:
    """The bus now. What nobody looks at is not fetched from the robot, so a viewer costs the link what it shows."""

    topics: Sequence[Topic[Any]] = TOPICS

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
            Sample(
                topic,
                each.message,
                each.payload,
                now_ns,
                None if each.attachment is None else each.attachment.time_s,
            )
            for topic, reader in self._readers.values()
            for each in reader.poll()
        ]
