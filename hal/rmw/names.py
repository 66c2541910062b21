"""How ROS 2 names become keys of zenoh, and back.

rmw_zenoh puts a topic on `<domain>/<topic>/<type>/<hash>` (its docs/design.md): the name without its first slash, the
type as DDS names it, and the RIHS01 hash of the type. zenoh-bridge-ros2dds puts it on its name alone.
"""

import re
from dataclasses import dataclass

from lira.hal.errors import ConfigError

ANY_HASH = "*"  # hears a type however the other end hashes it: one of Humble's has no hash to name
DOMAINS = range(233)  # what ROS_DOMAIN_ID may be
LONGEST = 1024  # characters of a key that is looked at
_SLASH = "%"
_HASH = re.compile(r"RIHS01_[0-9a-f]{64}|TypeHashNotSupported")
_DDS_TYPE = re.compile(r"([a-z][a-z0-9_]*)::(msg|srv|action)::dds_::([A-Za-z][A-Za-z0-9_]*)_")
_ROS_TYPE = re.compile(r"[a-z][a-z0-9_]*/(msg|srv|action)/[A-Za-z][A-Za-z0-9_]*")
_NAME = re.compile(r"(/?[A-Za-z_~][A-Za-z0-9_]*)(/[A-Za-z0-9_]+)*")


@dataclass(frozen=True, slots=True)
class RmwKey:
    """A key of rmw_zenoh. `topic` has no first slash; `type_hash` is as it stands in the key."""

    domain: int
    topic: str
    ros_type: str
    type_hash: str

    def __str__(self) -> str:
        """The key."""
        return f"{self.domain}/{self.topic}/{dds_type(self.ros_type)}/{self.type_hash}"


def parse_key(key: str) -> RmwKey | None:
    """Read a key of rmw_zenoh; None for any other."""
    parts = key.split("/")
    if len(key) > LONGEST or len(parts) < 4:
        return None
    domain, topic = domain_of(parts[0]), "/".join(parts[1:-2])
    found = ros_type(parts[-2])
    if domain is None or found is None or not _HASH.fullmatch(parts[-1]) or not is_name(topic):
        return None
    return RmwKey(domain, topic, found, parts[-1])


def domain_of(text: str) -> int | None:
    """Read a domain; None for what is none."""
    return int(text) if re.fullmatch(r"[0-9]{1,3}", text) and int(text) in DOMAINS else None


def is_name(text: str) -> bool:
    """Whether ROS 2 takes it for the name of a topic, service, node or namespace."""
    return len(text) <= LONGEST and _NAME.fullmatch(text) is not None


def check_namespace(text: str) -> str:
    """Return a namespace with its first slash, "/" for none. Raises `ConfigError`."""
    bare = text.strip("/")
    if bare and not is_name(bare):
        raise ConfigError(f"'{text}' is no namespace", "Use letters, digits and underscores, as in ROS: robot1.")
    return f"/{bare}"


def full_name(namespace: str, name: str) -> str:
    """Name of a topic in a namespace, with its first slash; an absolute name stays what it is."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def dds_type(name: str) -> str:
    """Name a type as DDS does: `std_msgs/msg/Bool` is `std_msgs::msg::dds_::Bool_`. Raises `ValueError`."""
    if not _ROS_TYPE.fullmatch(name):
        raise ValueError(f"'{name}' is no type of ROS 2")
    package, kind, kind_name = name.split("/")
    return f"{package}::{kind}::dds_::{kind_name}_"


def ros_type(name: str) -> str | None:
    """Name as ROS 2 does what DDS names; None for what is no such name."""
    match = _DDS_TYPE.fullmatch(name)
    return None if match is None else "/".join(match.groups())


def mangle(name: str) -> str:
    """Make one part of a key of a name: `/robot1/scan` is `%robot1%scan`."""
    return name.replace("/", _SLASH)


def demangle(part: str) -> str:
    """Return the name that was mangled."""
    return part.replace(_SLASH, "/")
