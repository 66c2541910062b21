"""Definitions of messages as ROS 2 writes them (.msg), read into what rosbags' type stores take.

rosbags reads them, too, and all of the language; that takes as long as the rest of a start. This reads what our
definitions and those of ROS that we speak are made of, and a test holds it to what rosbags reads.
"""

import re
from typing import Any

from rosbags.interfaces import Nodetype

BASE = frozenset(
    {"bool", "byte", "char", "string", "float32", "float64"}
    | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
)
_LINE = re.compile(r"(?P<kind>[\w/]+)(?P<many>\[\d*\])?\s+(?P<name>\w+)\s*(?:=\s*(?P<value>-?\d+)|\s\S+)?")
_TITLE = re.compile(r"^=+\nMSG: (\w+)/(\w+)\n", re.MULTILINE)
Definitions = dict[str, tuple[list[Any], list[Any]]]


def read(text: str, name: str) -> Definitions:
    """Read the definition of the type `name`, such as `std_msgs/msg/Header`. Raises `ValueError` for another line."""
    package = name.partition("/")[0]
    constants: list[Any] = []
    fields: list[Any] = []
    for line in text.splitlines():
        said = line.partition("#")[0].strip()
        if not said:
            continue
        found = _LINE.fullmatch(said)
        if found is None:
            raise ValueError(f"{name}: no field and no constant: {said}")
        if found["value"] is None:
            fields.append((found["name"], _kind(found["kind"], found["many"], package)))
        else:
            constants.append((found["name"], found["kind"], int(found["value"])))
    return {name: (constants, fields)}


def read_all(text: str) -> Definitions:
    """Read many, each below a line of `=` and its name, as a recording holds what a type refers to."""
    _, *parts = _TITLE.split(text)
    definitions: Definitions = {}
    for package, kind, body in zip(parts[::3], parts[1::3], parts[2::3], strict=True):
        definitions |= read(body, f"{package}/msg/{kind}")
    return definitions


def _kind(kind: str, many: str | None, package: str) -> Any:
    one: Any = Nodetype.BASE, (kind, 0)
    if kind not in BASE:
        home, _, own = kind.rpartition("/")
        one = Nodetype.NAME, f"{home or package}/msg/{own}"
    if many is None:
        return one
    length = many.strip("[]")
    return (Nodetype.ARRAY, (one, int(length))) if length else (Nodetype.SEQUENCE, (one, 0))
