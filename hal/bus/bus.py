"""The bus: a zenoh session with two links, publishers that follow the topic table, readers that keep the newest.

Every message carries an attachment. Nothing here calls back: readers are polled, so no topic can stall another.
"""

import itertools
import re
import secrets
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import zenoh
from zenoh import ext
from zenoh.handlers import FifoChannel, RingChannel

from lira.hal.bus.access_log import Refusals
from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.bus.boundary import Boundary
from lira.hal.bus.connection import Connection, Declared
from lira.hal.bus.keys import Keys, keys_from_environment, load_keys
from lira.hal.bus.topics import ATTACHMENT_BYTES, COMMANDS, QUESTION_BYTES, Qos, Topic, named
from lira.hal.bus.zenoh_session import open_session
from lira.hal.errors import BusError, CodecError, ConfigError
from lira.hal.messages.codec import decode, encode

M = TypeVar("M")

DEFAULT_ROBOT = "rosbot"
DEFAULT_ENDPOINT = "127.0.0.1:7447"
LINKS_PER_PEER = 2
QUERY_PAUSE_S = 0.1
QUESTIONS = 256  # that wait at most; each round answers no more
SHOWN_REASON = 300  # characters of why a question was refused
NONCE_BITS = 62
POLL_S = 0.0005
FIRST_S = 0.5  # how long to wait for a robot that is not there yet
WATCH_S = 3.0
CLOSE_S = 3.5  # longer than an attempt to connect takes


@dataclass(frozen=True, slots=True)
class Received(Generic[M]):
    """A message as it came. `arrived_s` is when it was polled, on this machine's monotonic clock.

    `key` is the whole key that it came on. `sender` is the id of the session that put it, "" if that does not stamp
    what it puts (ours and ROS bridges do).
    """

    message: M
    attachment: Attachment | None
    arrived_s: float
    key: str = ""
    sender: str = ""


@dataclass(frozen=True, slots=True)
class Answer:
    """What was answered to a query, and the session (`epoch`) of who answered."""

    payload: bytes
    epoch: int


class Publisher(Generic[M]):
    """Publishes one topic."""

    def __init__(
        self,
        connection: Connection,
        declare: Callable[[zenoh.Session], Any],
        epoch: int,
        count: Iterator[int],
        *,
        latched: bool,
    ) -> None:
        self._connection = connection
        self._declare = declare
        self._latched = latched
        self._kept: tuple[bytes, bytes] | None = None
        self._publisher = connection.declare(self._anew)
        self._epoch = epoch
        self._count = count

    @property
    def matching(self) -> bool:
        """Whether anybody listens."""
        return bool(self._publisher.now.matching_status.matching)

    def put(
        self, message: M, time_s: float, *, seq: int | None = None, answers: int = -1, released: bool = False
    ) -> None:
        """Send a message at `time_s` on the robot's clock; `seq` is the bus's count on this key unless given.

        Raises `BusError` when the session is closed, `CodecError` for what ROS cannot hold.
        """
        payload = encode(message)
        number = next(self._count) if seq is None else seq
        attachment = Attachment(self._epoch, number, round(time_s * 1e9), answers, released).to_bytes()
        if self._latched:
            self._kept = payload, attachment
        try:
            self._publisher.now.put(payload, attachment=attachment)
        except zenoh.ZError as error:
            if not self._connection.closed:
                return  # its session is just being replaced: lost, like all that was under way on it
            raise BusError(f"the bus does not take messages: {error}", "It is closed: start again.") from error

    def _anew(self, session: zenoh.Session) -> Any:
        """Declare it on a session, which for a latched topic holds what was put last."""
        publisher = self._declare(session)
        if self._kept is not None:
            payload, attachment = self._kept
            publisher.put(payload, attachment=attachment)
        return publisher


class Reader(Generic[M]):
    """Keeps the newest of a topic. What is too long or cannot be decoded is refused at the bus's `boundary`."""

    def __init__(
        self, connection: Connection, subscriber: Declared[Any], topic: Topic[M], depth: int, boundary: Boundary
    ) -> None:
        self._connection = connection
        self._subscriber = subscriber
        self._topic = topic
        self._boundary = boundary
        self._newest: Received[M] | None = None
        self._depth = depth
        self.full = False  # the last poll took all that is kept, so older messages may have been lost

    def poll(self) -> list[Received[M]]:
        """Return what came since the last poll, oldest first, as far back as the reader's depth.

        However fast somebody sends, it takes no more than that many, so whoever polls goes on.
        """
        found: list[Received[M]] = []
        self.full = True
        for _ in range(self._depth):
            if (sample := self._next()) is None:
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
        message = decode(self._topic.kind, bytes(sample.payload))
        sent = parse_attachment(None if attached is None else bytes(attached))
        return Received(message, sent, time.monotonic(), str(sample.key_expr), self._sender(sample))

    def newest(self) -> Received[M] | None:
        """Return the newest message that ever came, however old it is."""
        self.poll()
        return self._newest

    def _next(self) -> Any:
        return _take(self._connection, self._subscriber)

    def _sender(self, sample: zenoh.Sample) -> str:
        """Who put it. What comes without a stamp gets one of this session."""
        stamp = sample.timestamp
        if stamp is None or (sender := str(stamp.get_id())) == str(self._connection.session.zid()):
            return ""
        return sender


def _take(connection: Connection, declared: Declared[Any]) -> Any:
    """Take the next of what came, None for nothing. Raises `BusError` once the bus is closed."""
    try:
        return declared.now.try_recv()
    except zenoh.ZError as error:
        if not connection.closed:
            return None  # its session is just being replaced
        raise BusError(f"the bus is closed: {error}", "Open it again.") from error


class Question:
    """A query that waits for its answer, which names the session (`epoch`) that gives it, and what it answers."""

    def __init__(self, query: zenoh.Query, epoch: int) -> None:
        self._query = query
        self._epoch = epoch
        self.payload = b"" if query.payload is None else bytes(query.payload)
        self.answered = False

    def answer(self, payload: bytes) -> None:
        """Reply, and be done with it."""
        asked = _attachment(self._query)
        nonce = 0 if asked is None else asked.seq
        self.answered = True
        with self._query as query:
            query.reply(query.key_expr, payload, attachment=Attachment(self._epoch, nonce, 0).to_bytes())

    def refuse(self, why: str) -> None:
        """Reply that it cannot be done, and why."""
        self.answered = True
        with self._query as query:
            query.reply_err(why[:SHOWN_REASON].encode())


class Questions:
    """The queries on a key. Of those that nobody has looked at the newest `QUESTIONS` stay, and nobody waits."""

    def __init__(
        self, connection: Connection, queryable: Declared[Any], key: str, boundary: Boundary, epoch: int
    ) -> None:
        self._connection = connection
        self._queryable = queryable
        self._key = key
        self._boundary = boundary
        self._epoch = epoch

    def serve(
        self, answer: Callable[[Question], None], most: int = QUESTIONS, prepare: Callable[[], None] = lambda: None
    ) -> None:
        """Have `answer` answer or refuse what was asked since the last time, `most` at most; `prepare` comes before.

        Whatever goes wrong with one is that one's refusal. What `prepare` raises is passed on.
        """
        asked = self._take(most)
        if asked:
            prepare()
        for question in asked:
            with self._boundary.guard(self._key):
                try:
                    answer(question)
                finally:
                    if not question.answered:
                        question.refuse("it could not be done")

    def _take(self, most: int) -> list[Question]:
        asked: list[Question] = []
        for _ in range(most):
            query: zenoh.Query | None = _take(self._connection, self._queryable)
            if query is None:
                break
            if query.payload is not None and len(query.payload) > QUESTION_BYTES:
                self._boundary.refuse(self._key, "too long")
            else:
                asked.append(Question(query, self._epoch))
        return asked


class Bus:
    """A session of one robot's namespace: `robot` is the first part of every key.

    `listen` and `connect` are HOST:PORT; a robot listens, everybody else connects, and whoever connects keeps trying
    in the background. With `keys` (default: those that LIRA_KEYS names) it is encrypted and authenticated both ways;
    without, it listens on this machine only, unless `insecure`. Whoever connects and loses a link begins a new session
    (`connection.py`), with the same `epoch`; what was under way is lost.

    Peers hear the robot, not one another. With `watch` a session hears what all of them say, through the robot and
    over one link: for consoles and the like, not for driving; nobody there to connect to is a `BusError` then.
    `refusals` is what counts those whom keys keep out, for whoever reports it; `boundary` counts what came and was not
    taken, and guards whoever handles messages. `prefix` is what keys begin with instead of the name, for a robot that
    is not ours; it may be empty. `name` is the one that commands are sent in: that on the certificate, "" without keys.

    Raises `BusError` if the port is taken, `ConfigError` for a bad name, endpoint or keys.
    """

    def __init__(
        self,
        robot: str = DEFAULT_ROBOT,
        *,
        listen: str | None = None,
        connect: str | None = None,
        keys: Keys | None = None,
        insecure: bool = False,
        watch: bool = False,
        refusals: Refusals | None = None,
        prefix: str | None = None,
    ) -> None:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", robot):
            raise ConfigError(f"'{robot}' is no name for a robot", "Use letters, digits and underscores, as in ROS.")
        self.robot = robot
        self._prefix = robot if prefix is None else prefix
        self.endpoint = listen or connect or ""
        self.epoch = secrets.randbits(64)
        self.refusals = refusals or Refusals()
        self.boundary = Boundary()
        self._counts: dict[str, Iterator[int]] = {}  # what was sent, by key: they grow whoever sends
        keys = keys or keys_from_environment()
        self.encrypted = keys is not None
        self.name = keys.name if keys is not None and connect and prefix is None else ""
        for endpoint in (listen, connect):
            _check_address(endpoint)
        if listen and not (self.encrypted or insecure or _is_loopback(listen)):
            raise ConfigError(
                f"without keys anybody who reaches {listen} could drive the robot",
                "Make keys with: lira keys init keys; listen on 127.0.0.1; or say --insecure.",
            )
        self._keys = keys
        self._connection = Connection(
            lambda: open_session(robot, None, None, None),
            None
            if connect is None
            else lambda: open_session(robot, None, connect, keys, prefix=self._prefix, watch=watch),
            None
            if listen is None
            else lambda: open_session(robot, listen, None, self._read_keys(), prefix=self._prefix),
            None if keys is None else self._keys_changed,
        )
        if connect and not self._connection.wait_up(WATCH_S if watch else FIRST_S) and watch:
            self.close()
            raise BusError(f"cannot open the bus at {connect}", "Check the address, and that the robot runs.")

    def publisher(self, topic: Topic[M], qos: Qos | None = None) -> Publisher[M]:
        """Declare a publisher; `qos` replaces the table's."""
        qos = qos or topic.qos
        options: dict[str, Any] = {
            "encoding": zenoh.Encoding.APPLICATION_CDR.with_schema(topic.ros_type),
            "congestion_control": zenoh.CongestionControl.BLOCK if qos.wait else zenoh.CongestionControl.DROP,
            "priority": qos.priority,
            "express": qos.express,
            "reliability": qos.reliability,
        }
        key = self._key(self._own(topic).key)

        def declare(session: zenoh.Session) -> Any:
            if not qos.latched:
                return session.declare_publisher(key, **options)
            cache = ext.CacheConfig(max_samples=1)
            return ext.declare_advanced_publisher(session, key, cache=cache, publisher_detection=True, **options)

        count = self._counts.setdefault(key, itertools.count(1))
        return Publisher(self._connection, declare, self.epoch, count, latched=qos.latched)

    def put_raw(self, topic: Topic[Any], payload: bytes, attachment: bytes | None = None) -> None:
        """Send bytes as they are: for relays, recorders and tests of what a bus has to bear."""
        self._session.put(
            self._key(self._own(topic).key),
            payload,
            attachment=attachment,
            priority=topic.qos.priority,
            congestion_control=zenoh.CongestionControl.DROP,
        )

    def reader(self, topic: Topic[M], depth: int = 1) -> Reader[M]:
        """Declare a reader that keeps the newest `depth` messages between polls."""
        key = self._key(topic.key)

        def declare(session: zenoh.Session) -> Any:
            ring: RingChannel[zenoh.Sample] = RingChannel(depth)
            if not topic.qos.latched:
                return session.declare_subscriber(key, ring)
            history = ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
            return ext.declare_advanced_subscriber(session, key, ring, history=history)

        return Reader(self._connection, self._connection.declare(declare), topic, depth, self.boundary)

    def questions(self, key: str) -> Questions:
        """Answer queries on a key."""

        # A full ring lets go of the oldest, whose sender asks again. A full FIFO would stop zenoh's own threads.
        def declare(session: zenoh.Session) -> Any:
            return session.declare_queryable(self._key(key), RingChannel(QUESTIONS))

        return Questions(self._connection, self._connection.declare(declare), key, self.boundary, self.epoch)

    def ask(self, key: str, payload: bytes = b"", timeout_s: float = 5.0) -> bytes:
        """Query a key and return the answer; asks again while nobody is there to answer.

        Raises `BusError` if nobody answers in time, or with the reason of a refusal.
        """
        return self.answer(key, payload, timeout_s).payload

    def answer(self, key: str, payload: bytes = b"", timeout_s: float = 5.0, epoch: int | None = None) -> Answer:
        """As `ask`, and who answered. With `epoch` only the answer of that session counts.

        What is no answer to this very query (it carries a number that nobody can know before) is passed over.
        """
        deadline_s = time.monotonic() + timeout_s
        while (left_s := deadline_s - time.monotonic()) > 0:
            reply = self._get(key, payload, left_s)
            if isinstance(reply, Answer) and epoch in (None, reply.epoch):
                return reply
            if isinstance(reply, str) and reply != "Timeout":
                raise BusError(f"{self.robot} refused '{key}': {reply}")
            time.sleep(QUERY_PAUSE_S)
        raise BusError(
            f"no robot named '{self.robot}' answers '{key}' at {self.endpoint}",
            "Start one with: lira twin; or check the name, the address, the firewall and what your keys allow.",
        )

    def is_answered(self, key: str, timeout_s: float) -> bool:
        """Whether anybody answers a key now."""
        return isinstance(self._get(key, b"", timeout_s), Answer)

    def _get(self, key: str, payload: bytes, timeout_s: float) -> Answer | str | None:
        """One query: its first answer, or why it is refused; None if nobody is there."""
        nonce = secrets.randbits(NONCE_BITS)
        options: dict[str, Any] = {"payload": payload, "attachment": Attachment(0, nonce, 0).to_bytes()}
        try:
            handler = self._session.get(self._key(key), FifoChannel(4), timeout=timeout_s, **options)
        except zenoh.ZError as error:
            if not self._connection.closed:
                return None  # its session is just being replaced
            raise BusError(f"the bus is closed: {error}", "Open it again.") from error
        while True:
            try:
                reply = handler.try_recv()
            except zenoh.ZError:  # the channel is empty and closed: all replies are in
                return None
            if reply is None:
                time.sleep(POLL_S)
            elif reply.err is not None:
                return bytes(reply.err.payload).decode(errors="replace")
            elif reply.ok is not None and (sent := _attachment(reply.ok)) is not None and sent.seq == nonce:
                return Answer(bytes(reply.ok.payload), sent.epoch)

    @property
    def trouble(self) -> str:
        """Why nobody can connect to this bus although it listens, "" if they can."""
        return self._connection.trouble

    def peers(self) -> int:
        """How many others are connected."""
        return len(self._session.info.peers_zid()) + len(self._session.info.routers_zid())

    def links(self) -> int:
        """How many links are up: two for each peer, or one where UDP is blocked."""
        return len(self._session.info.links())

    def short_peers(self) -> int:
        """How many peers have less than two links, so that their UDP does not get through. Watchers need but one."""
        session = self._session
        counts = Counter(str(link.zid) for link in session.info.links())
        return sum(counts[str(zid)] < LINKS_PER_PEER for zid in session.info.peers_zid())

    def close(self, timeout_s: float = CLOSE_S) -> bool:
        """Close the session; False if a dead link kept it from closing in time. May be called twice."""
        return self._connection.close(timeout_s)

    @property
    def _session(self) -> zenoh.Session:
        return self._connection.session

    def _keys_changed(self) -> bool:
        return self._keys is not None and self._keys.changed()

    def _read_keys(self) -> Keys | None:
        """Those with which to listen from now on. Raises `ConfigError`."""
        if self._keys is not None and self._keys.changed():
            self._keys = load_keys(self._keys.folder)
        return self._keys

    def _own(self, topic: Topic[M]) -> Topic[M]:
        """A topic as this peer may put it: commands go in its own name."""
        return named(topic, self.name) if self.name and topic in COMMANDS else topic

    def _key(self, key: str) -> str:
        return f"{self._prefix}/{key}" if self._prefix else key


def _attachment(carrier: zenoh.Query | zenoh.Sample) -> Attachment | None:
    try:
        return parse_attachment(None if carrier.attachment is None else bytes(carrier.attachment))
    except CodecError:
        return None


def _is_loopback(endpoint: str) -> bool:
    host = endpoint.rpartition(":")[0].strip("[]")
    return host == "localhost" or host == "::1" or host.startswith("127.")


def _check_address(endpoint: str | None) -> None:
    if endpoint is None:
        return
    match = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9_.-]+):(\d{1,5})", endpoint)
    if match is None or not 0 < int(match[2]) < 65536:
        raise ConfigError(f"'{endpoint}' is no address", f"Write HOST:PORT, for example {DEFAULT_ENDPOINT}.")
