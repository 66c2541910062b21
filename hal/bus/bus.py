"""The bus: a zenoh session with two links, publishers that follow the topic table, readers that keep the newest.

Every message carries an attachment. Nothing here calls back: readers are polled, so no topic can stall another.
"""

import itertools
import secrets
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, TypeVar

import zenoh

from lira.hal.bus.attachment import attach as attached
from lira.hal.bus.boundary import Boundary
from lira.hal.bus.connection import Connection, Declared
from lira.hal.bus.endpoint import DEFAULT_ROBOT, check_address, check_name, is_loopback
from lira.hal.bus.publisher import Attach, Publisher
from lira.hal.bus.questions import Answer, Questions, ask_once
from lira.hal.bus.reader import Reader, Tap
from lira.hal.bus.security.access_log import Refusals
from lira.hal.bus.security.expiry import Reminder
from lira.hal.bus.security.keys import Keys, keys_from_environment, load_keys
from lira.hal.bus.topics import COMMANDS, Qos, Topic, named
from lira.hal.bus.zenoh_session import open_session
from lira.hal.clock import TimeBase, unix_offset_s
from lira.hal.errors import BusError, ConfigError
from lira.hal.rmw.services import TRIGGER
from lira.hal.rmw.tokens import Kind, Route

M = TypeVar("M")

LINKS_PER_PEER = 2
QUERY_PAUSE_S = 0.1
FIRST_S = 0.5  # how long to wait for a robot that is not there yet
WATCH_S = 3.0
CLOSE_S = 3.5  # longer than an attempt to connect takes


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
        check_name(robot)
        self.robot = robot
        self._prefix = robot if prefix is None else prefix
        self.endpoint = listen or connect or ""
        self.epoch = secrets.randbits(64)
        self.refusals = refusals or Refusals()
        self.boundary = Boundary()
        self._time_base = TimeBase()
        self._announced: list[Declared[Any]] = []
        self._counts: dict[str, Iterator[int]] = {}  # what was sent, by key: they grow whoever sends
        keys = keys or keys_from_environment()
        self.encrypted = keys is not None
        self.name = keys.name if keys is not None and connect and prefix is None else ""
        for endpoint in filter(None, (listen, connect)):
            check_address(endpoint)
        if listen and not (self.encrypted or insecure or is_loopback(listen)):
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
        self._reminder = None if keys is None else Reminder(keys)
        if connect and not self._connection.wait_up(WATCH_S if watch else FIRST_S) and watch:
            self.close()
            raise BusError(f"cannot open the bus at {connect}", "Check the address, and that the robot runs.")

    def count_from_1970(self, now: Callable[[], float]) -> None:
        """Tell and hear all times on the clock `now` as seconds since 1970; measured once, now."""
        self._time_base.offset_s = unix_offset_s(now)

    @property
    def offset_s(self) -> float:
        """What times on the bus are ahead of those of this process."""
        return self._time_base.offset_s

    def publisher(self, topic: Topic[M], qos: Qos | None = None, attach: Attach | None = None) -> Publisher[M]:
        """Declare a publisher; `qos` replaces the table's, `attach` what is attached: for who speaks for others."""
        key = self._key(self._own(topic).key)
        base = self._time_base
        own = partial(attached, self.epoch, self._counts.setdefault(key, itertools.count(1)), base)
        return Publisher(self._connection, key, topic, qos or topic.qos, attach or own, base)

    def put_raw(self, topic: Topic[Any], payload: bytes, attachment: bytes | None = None) -> None:
        """Send bytes as they are: for relays, recorders and tests of what a bus has to bear."""
        self._session.put(
            self._key(self._own(topic).key),
            payload,
            encoding=zenoh.Encoding.APPLICATION_CDR.with_schema(topic.ros_type),
            attachment=attachment,
            priority=topic.qos.priority,
            congestion_control=zenoh.CongestionControl.DROP,
        )

    def reader(self, topic: Topic[M], depth: int = 1) -> Reader[M]:
        """Declare a reader that keeps the newest `depth` messages between polls."""
        return Reader(self._connection, self._key(topic.key), topic, depth, self.boundary, self._time_base)

    def tap(self) -> Tap:
        """Hear everything that this session may hear, as it came."""
        return Tap(self._connection, self._prefix, self.boundary)

    def questions(self, key: str) -> Questions:
        """Answer queries on a key."""
        return Questions(self._connection, self._key(key), key, self.boundary, self.epoch)

    def announce(self, topic: Topic[Any]) -> None:
        """Make a topic known to bridges to ROS 2, so that `ros2 topic list` shows it before anybody listens."""
        self._announce(Kind.PUBLISHER, topic.key, topic.ros_type, latched=topic.qos.latched)

    def announce_service(self, key: str) -> None:
        """Make known to bridges that queries on a key are answered as a `Trigger`: without, they pass none on."""
        self._announce(Kind.SERVICE, key, TRIGGER)

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
            reply = ask_once(self._connection, self._key(key), payload, left_s)
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
        return isinstance(ask_once(self._connection, self._key(key), b"", timeout_s), Answer)

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
        return len(self.short_sessions())

    def short_sessions(self) -> frozenset[str]:
        """The ids of these peers' sessions."""
        session = self._session
        counts = Counter(str(link.zid) for link in session.info.links())
        return frozenset(zid for zid in map(str, session.info.peers_zid()) if counts[zid] < LINKS_PER_PEER)

    def close(self, timeout_s: float = CLOSE_S) -> bool:
        """Close the session; False if a dead link kept it from closing in time. May be called twice."""
        if self._reminder is not None:
            self._reminder.close()
        return self._connection.close(timeout_s)

    @property
    def _session(self) -> zenoh.Session:
        return self._connection.session

    def _announce(self, kind: Kind, key: str, ros_type: str, *, latched: bool = False) -> None:
        def declare(session: zenoh.Session) -> Any:
            route = Route(str(session.zid()), kind, self._key(key), ros_type, latched)
            return session.liveliness().declare_token(route.token)

        self._announced.append(self._connection.declare(declare))

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
