"""What a recording holds, in numbers: by topic how many messages, how often, how late, and what is missing."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.sensors import SENSORS
from lira.hal.bus.topics import APPLIED, CLOCK, DECISION, LATCHED_KEYS, SIM_STATE
from lira.hal.errors import CodecError
from lira.hal.messages import Call, Decision
from lira.tools.recording.reader import Recorded, Recording

# Their numbers are those of observations, of which not each brings something new, or commands.
NOT_COUNTED = {APPLIED.key, CLOCK.key, SIM_STATE.key, *(sensor.topic.key for sensor in SENSORS)}


@dataclass(slots=True)
class TopicSummary:
    """One topic. `missing` counts numbers that its senders gave and that were not recorded; None if they give none.

    `gap_s` is the longest time between two messages on the robot's clock.
    """

    key: str
    ros_type: str
    count: int = 0
    bytes: int = 0
    first_s: float = float("inf")
    last_s: float = float("-inf")
    gap_s: float = 0.0
    missing: int | None = None
    _next: dict[int, int] = field(default_factory=dict)  # number that a session gives next

    @property
    def rate_hz(self) -> float:
        """How often, on the robot's clock; 0 for one message."""
        return (self.count - 1) / (self.last_s - self.first_s) if self.last_s > self.first_s else 0.0

    def note(self, each: Recorded) -> None:
        """Count a message."""
        sent_s = each.sent_s
        if self.count:
            self.gap_s = max(self.gap_s, sent_s - self.last_s)
        self.count += 1
        self.bytes += len(each.payload)
        self.first_s, self.last_s = min(self.first_s, sent_s), max(self.last_s, sent_s)
        if each.attachment is not None and self.key not in NOT_COUNTED:
            self._note_number(each.attachment)

    def _note_number(self, sent: Attachment) -> None:
        due = self._next.get(sent.epoch, sent.seq)
        self.missing = (self.missing or 0) + max(0, sent.seq - due)
        self._next[sent.epoch] = max(due, sent.seq + 1)


@dataclass(slots=True)
class Summary:
    """A whole recording. Times are in seconds; `drivers` counts decisions by who drove, `calls` rising ones by kind."""

    robot: str
    profile: str
    world: str
    mode: str
    began_ns: int
    version: str
    command: str
    files: list[Path]
    topics: dict[str, TopicSummary]
    bytes: int
    torn: list[Path]
    lost: dict[str, int]
    drivers: Counter[str]
    calls: Counter[str]

    @property
    def count(self) -> int:
        """How many messages."""
        return sum(topic.count for topic in self.topics.values())

    @property
    def duration_s(self) -> float:
        """From the first message to the last, on the robot's clock; those sent once, maybe long before, aside."""
        firsts = [topic.first_s for topic in self.topics.values() if topic.key not in LATCHED_KEYS]
        return max((topic.last_s for topic in self.topics.values()), default=0.0) - min(firsts, default=0.0)


def summarise(recording: Recording) -> Summary:
    """Read all of a recording."""
    topics: dict[str, TopicSummary] = {}
    drivers: Counter[str] = Counter()
    calls: Counter[str] = Counter()
    call = Call.NONE
    for each in recording.messages():
        topic = topics.setdefault(each.key, TopicSummary(each.key, each.ros_type))
        topic.note(each)
        if each.key == DECISION.key:
            decision = _decision(each)
            if decision is not None:
                drivers[decision.driver] += 1
                calls[decision.call] += decision.call not in (Call.NONE, call)
                call = decision.call
    head = recording.head
    return Summary(
        robot=head.robot,
        profile=head.info.profile.name,
        world=head.world,
        mode=head.info.mode,
        began_ns=head.began_ns,
        version=head.version,
        command=head.command,
        files=recording.files,
        topics=dict(sorted(topics.items())),
        bytes=sum(path.stat().st_size for path in recording.files),
        torn=recording.torn,
        lost=recording.losses,
        drivers=drivers,
        calls=+calls,
    )


def _decision(each: Recorded) -> Decision | None:
    try:
        found: Decision = each.message
    except CodecError:
        return None
    return found
