"""What was heard and waits for the disk: bounded, and pictures give way first. Pure."""

from collections import Counter, deque

from lira.hal.bus.reader import RawSample
from lira.hal.bus.topics import PICTURE, TOPICS

_PICTURES = {topic.key for topic in TOPICS if topic.qos is PICTURE}


class Backlog:
    """Messages in order, `most_bytes` at most. `lost` counts by key what did not fit.

    When it is full the oldest pictures go; only when there are none, what comes is not taken.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._waiting: deque[RawSample | None] = deque()  # None: given up
        self._pictures: deque[int] = deque()  # where those stand, counted from the first message ever
        self._taken = 0  # messages that are not waiting any more
        self.bytes = 0
        self.lost: Counter[str] = Counter()

    def push(self, sample: RawSample) -> None:
        """Add what was heard."""
        size = len(sample.payload)
        while self.bytes + size > self._most_bytes and self._pictures:
            self._give_up(self._pictures.popleft() - self._taken)
        if self.bytes + size > self._most_bytes:
            self.lost[sample.key] += 1
            return
        if sample.key in _PICTURES:
            self._pictures.append(self._taken + len(self._waiting))
        self._waiting.append(sample)
        self.bytes += size

    def take(self) -> list[RawSample]:
        """Take all that waits, oldest first."""
        found = [sample for sample in self._waiting if sample is not None]
        self._taken += len(self._waiting)
        self._waiting.clear()
        self._pictures.clear()
        self.bytes = 0
        return found

    def _give_up(self, place: int) -> None:
        sample = self._waiting[place]
        assert sample is not None
        self._waiting[place] = None
        self.bytes -= len(sample.payload)
        self.lost[sample.key] += 1
