"""What hears a topic, or all of them as they come: polled, so that no topic can stall another."""

import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Generic, TypeVar

import zenoh
from zenoh import ext
from zenoh.handlers import RingChannel

from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.bus.boundary import Boundary
from lira.hal.bus.connection import Connection, Declared
from lira.hal.bus.publisher import shifted
from lira.hal.bus.topics import ATTACHMENT_BYTES, BY, LATCHED_KEYS, MESSAGE_BYTES, TOPICS, Topic
from lira.hal.clock import OWN_TIME, TimeBase
from lira.hal.messages.ros.codec import decode

M = TypeVar("M")

DEPTH = 8192  # between two polls: some seconds of a robot in lockstep at a hundred times real time
LATCHED_DEPTH = 64
_TYPES = {topic.key: topic.ros_type for topic in TOPICS}


@dataclass(frozen=True, slots=True)
class Received(Generic[M]):
    """A message as it came. `arrived_s` is when it was polled, on this machine's monotonic clock.

    `key` is the whole key that it came on. `payload` is the message as it travelled, `attached` what was attached to
    it, whoever's it is. `sender` is the id of the session that put it, "" if that does not stamp what it puts (ours and
    ROS bridges do).
    """

    message: M
    attachment: Attachment | None
    arrived_s: float
    key: str = ""
    sender: str = ""
    payload: bytes = b""
    attached: bytes | None = None

    @property
    def commander(self) -> str:
        """Whose command it is: with keys everybody commands in their own name. "" on a plain topic."""
        return self.key.rpartition(BY)[2] if BY in self.key else ""


class Reader(Generic[M]):
    """Keeps the newest `depth` of a topic. What is too long or cannot be decoded is refused at the bus's `boundary`.

    Times come as the session counts them itself, by its `base`.
    """

    def __init__(
        self,
        connection: Connection,
        key: str,
        topic: Topic[M],
        depth: int,
        boundary: Boundary,
        base: TimeBase = OWN_TIME,
    ) -> None:
        self._connection = connection
        self._topic = topic
        self._boundary = boundary
        self._base = base
        self._newest: Received[M] | None = None
        self._depth = depth
        self.full = False  # the last poll took all that is kept, so older messages may have been lost
        # Not by a method: what holds the subscriber is let go of with the reader, at once.
        self._subscriber = connection.declare(partial(subscribe, key, depth, latched=topic.qos.latched))

    def poll(self) -> list[Received[M]]:
        """Return what came since the last poll, oldest first, as far back as the reader's depth.

        However fast somebody sends, it takes no more than that many, so whoever polls goes on.
        """
        found: list[Received[M]] = []
        self.full = True
        for _ in range(self._depth):
            if (sample := take(self._connection, self._subscriber)) is None:
                self.full = False
                break
            with self._boundary.guard(self._topic.key):
                if (received := self._receive(sample)) is not None:
                    found.append(received)
        if found:
            self._newest = found[-1]
        return found

    def _receive(self, sample: zenoh.Sample) -> Received[M] | None:
        """Decode a sample. What is too long is not even copied."""
        attached = sample.attachment
        if len(sample.payload) > self._topic.max_bytes or (attached is not None and len(attached) > ATTACHMENT_BYTES):
            self._boundary.refuse(self._topic.key, "too long")
            return None
        payload, beside = bytes(sample.payload), None if attached is None else bytes(attached)
        message = decode(_kind_of(self._topic, len(payload)), payload)
        sent, arrived_s = parse_attachment(beside), time.monotonic()
        if self._base.offset_s:
            if getattr(message, "stamp_s", 0.0) != 0.0:  # ROS's word for none
                message = shifted(message, -self._base.offset_s)
            sent = None if sent is None else replace(sent, time_ns=sent.time_ns - self._base.offset_ns)
        return Received(message, sent, arrived_s, str(sample.key_expr), self._sender(sample), payload, beside)

    def newest(self) -> Received[M] | None:
        """Return the newest message that ever came, however old it is."""
        self.poll()
        return self._newest

    def _sender(self, sample: zenoh.Sample) -> str:
        """Who put it. What comes without a stamp gets one of this session."""
        stamp = sample.timestamp
        if stamp is None or (sender := str(stamp.get_id())) == str(self._connection.session.zid()):
            return ""
        return sender


def subscribe(key: str, depth: int, session: zenoh.Session, *, latched: bool) -> Any:
    """Declare a ring of samples on a session; of a latched key it holds the last value, too."""
    ring: RingChannel[zenoh.Sample] = RingChannel(depth)
    if not latched:
        return session.declare_subscriber(key, ring)
    history = ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
    return ext.declare_advanced_subscriber(session, key, ring, history=history)


def take(connection: Connection, declared: Declared[Any]) -> Any:
    """Take the next of what came to something declared, None for nothing. Raises `BusError` once the bus is closed."""
    try:
        return declared.now.try_recv()
    except zenoh.ZError as error:
        connection.check_open(error)
        return None  # its session is just being replaced


@dataclass(frozen=True, slots=True)
class RawSample:
    """A message as it travelled. `key` lies below the robot's name.

    `ros_type` is what its sender says it is, else what the table of topics says, "" where neither does. `arrived_s` is
    when it was polled, on this machine's monotonic clock.
    """

    key: str
    ros_type: str
    payload: bytes
    attachment: bytes | None
    arrived_s: float


class Tap:
    """Everything below `prefix` that this session is allowed to hear, latched values included.

    Commands go to the robot alone, so what reaches the wheels is heard as `cmd_vel/applied`.
    """

    def __init__(self, connection: Connection, prefix: str, boundary: Boundary) -> None:
        self._connection = connection
        self._boundary = boundary
        self._skip = len(prefix) + 1 if prefix else 0
        # What is latched is heard twice, by one who asks for the last value and by one who does not: that is left out.
        self._live = connection.declare(partial(_all_below, f"{prefix}/**" if prefix else "**"))
        self._latched = [
            connection.declare(partial(subscribe, f"{prefix}/{key}".lstrip("/"), LATCHED_DEPTH, latched=True))
            for key in sorted(LATCHED_KEYS)
        ]
        self.full = False  # the last poll took all that is kept, so older messages may have been lost

    def poll(self) -> list[RawSample]:
        """Return what came since the last poll, in the order in which it came; latched values first."""
        found = [sample for each in self._latched for sample in self._drain(each, LATCHED_DEPTH)]
        live = self._drain(self._live, DEPTH)
        self.full = len(live) == DEPTH
        return found + [sample for sample in live if sample.key not in LATCHED_KEYS]

    def _drain(self, declared: Any, most: int) -> list[RawSample]:
        found: list[RawSample] = []
        for _ in range(most):
            if (sample := take(self._connection, declared)) is None:
                break
            with self._boundary.guard("**"):
                if (raw := self._raw(sample)) is not None:
                    found.append(raw)
        return found

    def _raw(self, sample: zenoh.Sample) -> RawSample | None:
        key, attached = str(sample.key_expr)[self._skip :], sample.attachment
        if len(sample.payload) > MESSAGE_BYTES or (attached is not None and len(attached) > ATTACHMENT_BYTES):
            self._boundary.refuse(key, "too long")
            return None
        schema = str(sample.encoding).partition(";")[2]
        attachment = None if attached is None else bytes(attached)
        return RawSample(key, schema or _TYPES.get(key, ""), bytes(sample.payload), attachment, time.monotonic())


def _all_below(key: str, session: zenoh.Session) -> Any:
    ring: RingChannel[zenoh.Sample] = RingChannel(DEPTH)
    return session.declare_subscriber(key, ring)


def _kind_of(topic: Topic[Any], size: int) -> type[Any]:
    """What a payload of this size is to be decoded as."""
    return topic.kind if topic.stamped is None or size <= topic.plain_bytes else topic.stamped
