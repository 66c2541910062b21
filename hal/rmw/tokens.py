"""Liveliness tokens: how nodes, publishers, subscriptions and services are known to all others.

rmw_zenoh declares one for each, with all that `ros2 topic info` shows in its key. zenoh-bridge-ros2dds declares one for
each route, by which another bridge makes the topic known on its own side. Both are written and read here.
"""

from dataclasses import dataclass
from enum import StrEnum

from lira.hal.rmw.names import (
    LONGEST,
    RmwKey,
    dds_type,
    demangle,
    domain_of,
    is_name,
    mangle,
    ros_type,
)
from lira.hal.rmw.qos import RosQos, parse_qos

SPACE = "@ros2_lv"
ALL_RMW = f"{SPACE}/**"
ALL_BRIDGES = f"@/*/{SPACE}/**"
_NODE_PARTS, _ENDPOINT_PARTS = 9, 13
_BRIDGE_SLASH = "§"
_BRIDGE_LATCHED = "::1:0,1"  # by DDS's numbers: transient local, keep the last 1


class Kind(StrEnum):
    """What a token is of."""

    NODE = "NN"
    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"
    SERVICE = "SS"
    CLIENT = "SC"


_KINDS = {kind.value for kind in Kind}


@dataclass(frozen=True, slots=True)
class Node:
    """A node in the graph. `session` is the id of its zenoh session, `number` unique in that."""

    domain: int
    session: str
    number: int
    name: str
    namespace: str = "/"
    enclave: str = "/"

    @property
    def token(self) -> str:
        """Key of its token."""
        return self.part_token(self.number, Kind.NODE)

    def part_token(self, number: int, kind: Kind) -> str:
        """How the token of something of this node begins."""
        places = mangle(self.enclave), mangle(self.namespace), mangle(self.name)
        return "/".join([SPACE, str(self.domain), self.session, str(self.number), str(number), kind, *places])


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher, subscription, service or client of a node. `name` has its first slash."""

    node: Node
    number: int
    kind: Kind
    name: str
    ros_type: str
    type_hash: str
    qos: RosQos

    @property
    def token(self) -> str:
        """Key of its token."""
        parts = mangle(self.name), dds_type(self.ros_type), self.type_hash, self.qos.encode()
        return "/".join([self.node.part_token(self.number, self.kind), *parts])

    @property
    def key(self) -> str:
        """Key on which it sends and hears."""
        return str(RmwKey(self.node.domain, self.name.strip("/"), self.ros_type, self.type_hash))


@dataclass(frozen=True, slots=True)
class Route:
    """What a bridge makes known of one topic or service: `key` is where it is on zenoh.

    What is `latched` has to say so: the other end's writer would not serve readers that want the last value.
    """

    bridge: str
    kind: Kind
    key: str
    ros_type: str
    latched: bool = False

    @property
    def token(self) -> str:
        """Key of its token; other quality of service is left to the other end's defaults."""
        qos = [_BRIDGE_LATCHED if self.latched else ":::"] if self.kind in (Kind.PUBLISHER, Kind.SUBSCRIPTION) else []
        parts = self.key.replace("/", _BRIDGE_SLASH), self.ros_type.replace("/", _BRIDGE_SLASH)
        return "/".join(["@", self.bridge, SPACE, self.kind, *parts, *qos])


def parse_token(key: str) -> Node | Endpoint | None:
    """Read a token of rmw_zenoh; None for what is none, or not whole."""
    parts = key.split("/")
    if len(key) > LONGEST or len(parts) < _NODE_PARTS or not all(parts) or parts[0] != SPACE:
        return None
    domain, number, part_number = domain_of(parts[1]), _count(parts[3]), _count(parts[4])
    if domain is None or number is None or part_number is None or parts[5] not in _KINDS:
        return None
    enclave, namespace, name = (demangle(part) for part in parts[6:9])
    if not is_name(name) or not (namespace == "/" or is_name(namespace)):
        return None
    node = Node(domain, parts[2], number, name, namespace, enclave)
    return node if parts[5] == Kind.NODE else _endpoint(node, part_number, Kind(parts[5]), parts)


def _endpoint(node: Node, number: int, kind: Kind, parts: list[str]) -> Endpoint | None:
    if len(parts) != _ENDPOINT_PARTS:
        return None
    name, found, qos = demangle(parts[9]), ros_type(parts[10]), parse_qos(parts[12])
    if found is None or qos is None or not is_name(name):
        return None
    return Endpoint(node, number, kind, name, found, parts[11], qos)


def parse_route(key: str) -> Route | None:
    """Read a bridge's token; None for what is none, and for an action's."""
    parts = key.split("/")
    if len(key) > LONGEST or not 6 <= len(parts) <= 7 or not all(parts) or (parts[0], parts[2]) != ("@", SPACE):
        return None
    topic, found = parts[4].replace(_BRIDGE_SLASH, "/"), parts[5].replace(_BRIDGE_SLASH, "/")
    if parts[3] not in _KINDS or parts[3] == Kind.NODE or not is_name(topic):
        return None
    return Route(parts[1], Kind(parts[3]), topic, found)


def _count(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 10 else None
