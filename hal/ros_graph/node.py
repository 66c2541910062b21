"""A node of a ROS 2 graph whose middleware is rmw_zenoh: what it hears, says and answers, and its tokens.

Topics are those of `hal.bus.topics` by their ROS names: relative ones lie in the node's namespace, and one that begins
with a slash stays what it is. As on the bus nothing here calls back.
"""

import itertools
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, TypeVar

import zenoh
from zenoh import Reliability

from lira.hal.bus.boundary import Boundary
from lira.hal.bus.connection import Connection, Declared
from lira.hal.bus.endpoint import check_address, is_loopback
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.reader import Reader
from lira.hal.bus.topics import Qos, Topic
from lira.hal.errors import ConfigError
from lira.hal.rmw.attachment import RmwAttachment, gid_of
from lira.hal.rmw.hashes import type_hash
from lira.hal.rmw.names import ANY_HASH, DOMAINS, check_namespace, dds_type, full_name, is_name
from lira.hal.rmw.qos import RosQos
from lira.hal.rmw.services import TRIGGER, Answer
from lira.hal.rmw.tokens import Endpoint, Kind, Node
from lira.hal.ros_graph.service import RosService
from lira.hal.ros_graph.session import open_ros_session

M = TypeVar("M")
FIRST_S = 0.5  # how long to wait for a router that is not there yet
CLOSE_S = 3.5
SENSOR_DEPTH, DEPTH = 5, 10  # of ROS's own profiles for sensors and for the rest
SERVICE_QOS = RosQos(depth=10)


class RosNode:
    """A node, with a zenoh session of its own.

    `connect` is where the graph's router listens, which may start later; with `listen` instead it is the router.
    `hashes` gives a type another hash than its own, by its name: one of Humble's has none to name.

    Raises `ConfigError` for an address that other machines reach, unless `insecure`, and for bad names; `BusError` if
    its port is taken.
    """

    def __init__(
        self,
        name: str,
        *,
        connect: str | None = None,
        listen: str | None = None,
        domain: int = 0,
        namespace: str = "/",
        hashes: Mapping[str, str] | None = None,
        insecure: bool = False,
    ) -> None:
        self.endpoint = connect or listen or ""
        for each in filter(None, (connect, listen)):
            check_address(each)
        if domain not in DOMAINS:
            raise ConfigError(f"{domain} is no domain of ROS", f"Choose one from 0 to {DOMAINS[-1]}.")
        if not is_name(name) or "/" in name:
            raise ConfigError(f"'{name}' is no name for a node", "Use letters, digits and underscores.")
        if listen and not (insecure or is_loopback(listen)):
            remedy = "Listen on 127.0.0.1, be a client of a router of theirs, or say --insecure."
            raise ConfigError(f"anybody who reaches {listen} could drive the robot: ROS has no keys here", remedy)
        self.boundary = Boundary()
        self._domain, self._name, self._namespace = domain, name, check_namespace(namespace)
        self._hashes = hashes or {}
        self._numbers = itertools.count(1)  # of endpoints; the node itself has 0
        self._connection = Connection(
            open_ros_session,
            None if connect is None else partial(open_ros_session, connect=connect),
            None if listen is None else partial(open_ros_session, listen=listen),
        )
        self._tokens: list[Declared[Any]] = []
        self._declare(lambda node: node.token)
        if connect:
            self._connection.wait_up(FIRST_S)

    def reader(self, topic: Topic[M], depth: int = 1) -> Reader[M]:
        """Declare a subscription that keeps the newest `depth` messages between polls, however its type is hashed."""
        name, number = self.full_name(topic.key), next(self._numbers)
        key = f"{self._domain}/{name.strip('/')}/{dds_type(topic.ros_type)}/{ANY_HASH}"
        reader = Reader(self._connection, key, topic, depth, self.boundary)
        self._declare(lambda node: self._endpoint(node, Kind.SUBSCRIPTION, number, name, topic).token)
        return reader

    def publisher(self, topic: Topic[M], qos: Qos | None = None) -> Publisher[M]:
        """Declare a publisher; `qos` replaces the table's. What is latched reaches who comes later."""
        name, number = self.full_name(topic.key), next(self._numbers)

        def endpoint(node: Node) -> Endpoint:
            return self._endpoint(node, Kind.PUBLISHER, number, name, topic)

        own = endpoint(self._node(self._connection.session))
        attach = partial(_attach, itertools.count(1), gid_of(own.token))
        publisher = Publisher(self._connection, own.key, topic, qos or topic.qos, attach)
        self._declare(lambda node: endpoint(node).token)
        return publisher

    def service(self, name: str, answer: Callable[[], Answer]) -> RosService:
        """Offer a service, a `Trigger`; `answer` is called by its `serve`."""
        name, number = self.full_name(name), next(self._numbers)

        def endpoint(node: Node) -> Endpoint:
            return Endpoint(node, number, Kind.SERVICE, name, TRIGGER, self._hash(TRIGGER), SERVICE_QOS)

        key = endpoint(self._node(self._connection.session)).key
        service = RosService(self._connection, key, answer, self.boundary)
        self._declare(lambda node: endpoint(node).token)
        return service

    def full_name(self, name: str) -> str:
        """Name of a topic or service as the graph has it."""
        return full_name(self._namespace, name)

    def peers(self) -> int:
        """How many others are connected: routers, or nodes where this is the router."""
        info = self._connection.session.info
        return len(info.peers_zid()) + len(info.routers_zid())

    def links(self) -> int:
        """How many links are up."""
        return len(self._connection.session.info.links())

    def close(self, timeout_s: float = CLOSE_S) -> bool:
        """Leave the graph; False if a dead link kept it from closing in time. May be called twice."""
        return self._connection.close(timeout_s)

    def _node(self, session: zenoh.Session) -> Node:
        return Node(self._domain, str(session.zid()), 0, self._name, self._namespace)

    def _endpoint(self, node: Node, kind: Kind, number: int, name: str, topic: Topic[Any]) -> Endpoint:
        return Endpoint(node, number, kind, name, topic.ros_type, self._hash(topic.ros_type), ros_qos(topic))

    def _hash(self, ros_type: str) -> str:
        return self._hashes.get(ros_type) or type_hash(ros_type)

    def _declare(self, token: Callable[[Node], str]) -> None:
        """Declare a token, on this session and on all that replace it: it names the session."""
        self._tokens.append(
            self._connection.declare(lambda session: session.liveliness().declare_token(token(self._node(session))))
        )


def ros_qos(topic: Topic[Any]) -> RosQos:
    """Quality of service of a topic, as ROS has it."""
    urgent = topic.qos.reliability == Reliability.BEST_EFFORT
    return RosQos(not urgent, topic.qos.latched, 1 if topic.qos.latched else SENSOR_DEPTH if urgent else DEPTH)


def _attach(
    count: Iterator[int],
    gid: bytes,
    time_s: float,  # noqa: ARG001 - the arguments are those of every attachment
    seq: int | None,  # noqa: ARG001
    answers: int,  # noqa: ARG001
    *,
    released: bool,  # noqa: ARG001
) -> bytes:
    return RmwAttachment(next(count), time.time_ns(), gid).to_bytes()
