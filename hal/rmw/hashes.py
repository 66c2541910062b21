"""RIHS01: the hash (REP-2016) by which ROS 2 and rmw_zenoh know a type."""

from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from lira.hal.messages.ros.types import types_with


@cache
def type_hash(ros_type: str) -> str:
    """Hash of a message or of a service (`hal.rmw.services`), with `RIHS01_` before it. Raises `KeyError`.

    rosidl takes `char` for `uint8` before it hashes; rosbags does not.
    """
    types = types_with(ros_type)
    if types is None:
        raise KeyError(ros_type)
    store = Typestore()
    for name, (constants, fields) in types.fielddefs.items():
        store.fielddefs[name] = constants, _plain(fields)
    return str(store.hash_rihs01(ros_type))


def _plain(node: Any) -> Any:
    """The same fields, with no `char` in them."""
    if node == (Nodetype.BASE, ("char", 0)):
        return Nodetype.BASE, ("uint8", 0)
    if isinstance(node, tuple | list):
        return type(node)(_plain(part) for part in node)
    return node
