"""The bus: a zenoh session with two links, publishers that follow the topic table, readers that keep the newest.

Every message carries an attachment. Nothing here calls back: readers are polled, so no topic can stall another.
"""

import json
import re
import secrets
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import zenoh
from zenoh import ext
from zenoh.handlers import FifoChannel, RingChannel

from hal.attachment import Attachment, parse_attachment
from hal.codec import decode, encode
from hal.errors import BusError, CodecError, ConfigError
from hal.keys import Keys, keys_from_environment
from hal.refusals import Refusals
from hal.topics import Qos, Topic

M = TypeVar("M")

DEFAULT_ROBOT = "rosbot"
DEFAULT_ENDPOINT = "127.0.0.1:7447"
LINKS_PER_PEER = 2
LEASE_MS = 2000
OPEN_MS = 2000
QUERY_PAUSE_S = 0.1
POLL_S = 0.0005


@dataclass(frozen=True, slots=True)
class Received(Generic[M]):
    """A message as it came. `arrived_s` is when it was polled, on this machine's monotonic clock."""

    message: M
    attachment: Attachment | None
    arrived_s: float


class Publisher(Generic[M]):
    """Publishes one topic."""

    def __init__(self, publisher: Any, epoch: int) -> None:
        self._publisher = publisher
        self._epoch = epoch
        self._seq = 0

    @property
    def matching(self) -> bool:
        """Whether anybody listens."""
        return bool(self._publisher.matching_status.matching)

    def put(
        self, message: M, time_s: float, *, seq: int | None = None, answers: int = -1, released: bool = False
    ) -> None:
        """Send a message at `time_s` on the robot's clock; `seq` is its own count unless given.

        Raises `BusError` when the session is closed, `CodecError` for what ROS cannot hold.
        """
        self._seq = self._seq + 1 if seq is None else seq
        attachment = Attachment(self._epoch, self._seq, round(time_s * 1e9), answers, released)
        try:
            self._publisher.put(encode(message), attachment=attachment.to_bytes())
        except zenoh.ZError as error:
            raise BusError(f"the bus does not take messages: {error}", "It is closed: start again.") from error


class Reader(Generic[M]):
    """Keeps the newest of a topic. What cannot be decoded is dropped and counted in `dropped`, by reason."""

    def __init__(self, subscriber: Any, kind: type[M]) -> None:
        self._subscriber = subscriber
        self._kind = kind
        self._newest: Received[M] | None = None
        self.dropped: Counter[str] = Counter()

    def poll(self) -> list[Received[M]]:
        """Return what came since the last poll, oldest first, as far back as the reader's depth."""
        found: list[Received[M]] = []
        while (sample := self._next()) is not None:
            try:
                message = decode(self._kind, bytes(sample.payload))
            except CodecError:
                self.dropped["undecodable"] += 1
                continue
            attached = None if sample.attachment is None else bytes(sample.attachment)
            found.append(Received(message, parse_attachment(attached), time.monotonic()))
        if found:
            self._newest = found[-1]
        return found

    def newest(self) -> Received[M] | None:
        """Return the newest message that ever came, however old it is."""
        self.poll()
        return self._newest

    def _next(self) -> Any:
        try:
            return self._subscriber.try_recv()
        except zenoh.ZError as error:
            raise BusError(f"the bus is closed: {error}", "Open it again.") from error


class Question:
    """A query that waits for its answer."""

    def __init__(self, query: zenoh.Query) -> None:
        self._query = query
        self.payload = b"" if query.payload is None else bytes(query.payload)

    def answer(self, payload: bytes) -> None:
        """Reply, and be done with it."""
        with self._query as query:
            query.reply(query.key_expr, payload)

    def refuse(self, why: str) -> None:
        """Reply that it cannot be done, and why."""
        with self._query as query:
            query.reply_err(why.encode())


class Bus:
    """A session of one robot's namespace: `robot` is the first part of every key.

    `listen` and `connect` are HOST:PORT; a robot listens, everybody else connects, and whoever connects keeps trying
    in the background. With `keys` (default: those that LIRA_KEYS names) it is encrypted and authenticated both ways;
    without, it listens on this machine only, unless `insecure`.

    Peers hear the robot, not one another. With `watch` a session hears what all of them say, through the robot and
    over one link: for consoles and the like, not for driving; nobody there to connect to is a `BusError` then.
    `refusals` is what counts those whom keys keep out, for whoever reports it. `prefix` is what keys begin with instead
    of the name, for a robot that is not ours; it may be empty.

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
        keys = keys or keys_from_environment()
        self.encrypted = keys is not None
        for endpoint in (listen, connect):
            _check_address(endpoint)
        if listen and not (self.encrypted or insecure or _is_loopback(listen)):
            raise ConfigError(
                f"without keys anybody who reaches {listen} could drive the robot",
                "Make keys with: lira keys init keys; listen on 127.0.0.1; or say --insecure.",
            )
        self._session = _open(robot, listen, connect, keys, watch)

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
        if qos.latched:
            cache = ext.CacheConfig(max_samples=1)
            publisher: Any = ext.declare_advanced_publisher(
                self._session, self._key(topic.key), cache=cache, publisher_detection=True, **options
            )
        else:
            publisher = self._session.declare_publisher(self._key(topic.key), **options)
        return Publisher(publisher, self.epoch)

    def put_raw(self, topic: Topic[Any], payload: bytes, attachment: bytes | None = None) -> None:
        """Send bytes as they are: for relays, recorders and tests of what a bus has to bear."""
        self._session.put(
            self._key(topic.key),
            payload,
            attachment=attachment,
            priority=topic.qos.priority,
            congestion_control=zenoh.CongestionControl.DROP,
        )

    def reader(self, topic: Topic[M], depth: int = 1) -> Reader[M]:
        """Declare a reader that keeps the newest `depth` messages between polls."""
        ring: RingChannel[zenoh.Sample] = RingChannel(depth)
        if topic.qos.latched:
            history = ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
            subscriber: Any = ext.declare_advanced_subscriber(
                self._session, self._key(topic.key), ring, history=history
            )
        else:
            subscriber = self._session.declare_subscriber(self._key(topic.key), ring)
        return Reader(subscriber, topic.kind)

    def questions(self, key: str) -> Callable[[], Question | None]:
        """Answer queries on a key: returns a poll that gives the next question or None."""
        queryable = self._session.declare_queryable(self._key(key), FifoChannel(16))

        def poll() -> Question | None:
            query = queryable.try_recv()
            return None if query is None else Question(query)

        return poll

    def ask(self, key: str, payload: bytes = b"", timeout_s: float = 5.0) -> bytes:
        """Query a key and return the answer; asks again while nobody is there to answer.

        Raises `BusError` if nobody answers in time, or with the reason of a refusal.
        """
        deadline_s = time.monotonic() + timeout_s
        while (left_s := deadline_s - time.monotonic()) > 0:
            reply = self._get(key, payload, left_s)
            if reply is None:
                time.sleep(QUERY_PAUSE_S)
            elif reply.ok is not None:
                return bytes(reply.ok.payload)
            elif reply.err is not None and (why := bytes(reply.err.payload).decode(errors="replace")) != "Timeout":
                raise BusError(f"{self.robot} refused '{key}': {why}")
        raise BusError(
            f"no robot named '{self.robot}' answers '{key}' at {self.endpoint}",
            "Start one with: lira twin; or check the name, the address and the firewall.",
        )

    def is_answered(self, key: str, timeout_s: float) -> bool:
        """Whether anybody answers a key now."""
        reply = self._get(key, b"", timeout_s)
        return reply is not None and reply.ok is not None

    def _get(self, key: str, payload: bytes, timeout_s: float) -> zenoh.Reply | None:
        """One query: its first reply, None if nobody is there."""
        handler = self._session.get(self._key(key), FifoChannel(4), payload=payload, timeout=timeout_s)
        while True:
            try:
                reply = handler.try_recv()
            except zenoh.ZError:  # the channel is empty and closed: all replies are in
                return None
            if reply is not None:
                return reply
            time.sleep(POLL_S)

    def peers(self) -> int:
        """How many others are connected."""
        return len(self._session.info.peers_zid()) + len(self._session.info.routers_zid())

    def links(self) -> int:
        """How many links are up: two for each peer, or one where UDP is blocked."""
        return len(self._session.info.links())

    def short_peers(self) -> int:
        """How many peers have less than two links, so that their UDP does not get through. Watchers need but one."""
        counts = Counter(str(link.zid) for link in self._session.info.links())
        return sum(counts[str(zid)] < LINKS_PER_PEER for zid in self._session.info.peers_zid())

    def close(self, timeout_s: float = 2.0) -> bool:
        """Close the session; False if a dead link kept it from closing in time. May be called twice."""
        closer = threading.Thread(target=self._session.close, daemon=True, name="bus-close")
        closer.start()
        closer.join(timeout_s)
        return not closer.is_alive()

    def _key(self, key: str) -> str:
        return f"{self._prefix}/{key}" if self._prefix else key


def _open(robot: str, listen: str | None, connect: str | None, keys: Keys | None, watch: bool) -> zenoh.Session:
    config = zenoh.Config()
    for key, value in {
        # Both ends are peers: a client would use one link only. What peers say is passed on to clients alone.
        "mode": "client" if watch else "peer",
        "listen/endpoints": _links(listen, keys),
        "connect/endpoints": _links(connect, keys),
        "connect/timeout_ms": 0,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/unicast/max_links": 2,
        # Whoever has no keys for a robot that wants some hears it after this long.
        "transport/unicast/open_timeout": OPEN_MS,
        "transport/link/tx/lease": LEASE_MS,
        # It can lose a message when a receiver stalls.
        "transport/shared_memory/enabled": False,
        # Late readers of a latched topic are served by its time stamp.
        "timestamping/enabled": True,
        **({} if keys is None else keys.zenoh_config(robot)),
    }.items():
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        # zenoh nests its reasons in brackets, each with the place in its sources.
        reason = str(error).split(" at /")[0].split(": [")[-1]
        if "in use" in reason:
            raise BusError(
                f"{listen} is already in use",
                "Stop the other program (another robot?), or choose another port with --listen HOST:PORT.",
            ) from error
        raise BusError(
            f"cannot open the bus at {listen or connect}: {reason}", "Check the address, and that the robot runs."
        ) from error


def _is_loopback(endpoint: str) -> bool:
    host = endpoint.rpartition(":")[0].strip("[]")
    return host == "localhost" or host == "::1" or host.startswith("127.")


def _check_address(endpoint: str | None) -> None:
    if endpoint is None:
        return
    match = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9_.-]+):(\d{1,5})", endpoint)
    if match is None or not 0 < int(match[2]) < 65536:
        raise ConfigError(f"'{endpoint}' is no address", "Write HOST:PORT, for example 127.0.0.1:7447.")


def _links(endpoint: str | None, keys: Keys | None) -> list[str]:
    """One TCP link for what must arrive and one UDP link for what must be new (zenoh picks by reliability).

    With keys these are TLS, and the datagrams of QUIC.
    """
    if endpoint is None:
        return []
    stream, datagram = ("tcp", "udp") if keys is None else ("tls", "quic")
    return [f"{stream}/{endpoint}?rel=1", f"{datagram}/{endpoint}?rel=0"]
