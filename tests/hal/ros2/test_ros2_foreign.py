"""Every message is read by ROS 2's own type support and by Foxglove's decoders, and its type is hashed as ROS does."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from foreign import run_foxglove, run_ros

from lira.hal.messages.ros.codec import decode, encode, ros_type_of
from lira.hal.messages.ros.types import TYPES, definition
from lira.hal.rmw.hashes import type_hash
from lira.tools.bench.parts.samples import MESSAGES

SCRIPTS = Path(__file__).parent / "foreign"
NOT_INSTALLED = {"lira_msgs", "tf2_msgs"}  # PyPI has no wheel of tf2_msgs
ENCODED = [(message, ros_type_of(type(message)), encode(message)) for message in MESSAGES]


def plain(value):
    """A decoded message in the form in which the script for Foxglove's decoder writes one."""
    if hasattr(value, "__dataclass_fields__"):
        names = (name for name in value.__dataclass_fields__ if name != "__msgtype__" and not name.isupper())
        return {name: plain(getattr(value, name)) for name in names}  # without the type's constants
    if isinstance(value, np.ndarray | list):
        return [plain(each) for each in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return value


def test_ros_itself_reads_every_message_and_writes_the_same():
    asked = json.dumps([[ros_type, payload.hex()] for _, ros_type, payload in ENCODED]).encode()
    told = json.loads(run_ros(SCRIPTS / "ros_types.py", data=asked))
    missing = {ros_type.partition("/")[0] for ros_type, data in told if data is None}
    assert missing <= NOT_INSTALLED
    read = [(message, data) for (message, _, _), (_, data) in zip(ENCODED, told, strict=True) if data is not None]
    assert len(read) > len(ENCODED) / 2
    for message, data in read:
        ours, theirs = encode(message), bytes.fromhex(data)
        again = [plain(TYPES.deserialize_cdr(each, ros_type_of(type(message)))) for each in (ours, theirs)]
        assert again[0] == again[1]
        decode(type(message), theirs)


def test_ros_itself_hashes_every_type_as_we_do():
    names = sorted({ros_type for _, ros_type, _ in ENCODED})
    told = json.loads(run_ros(SCRIPTS / "ros_graph.py", data=json.dumps(names).encode()).splitlines()[-1])
    assert {name.partition("/")[0] for name in names} - {name.partition("/")[0] for name in told} <= NOT_INSTALLED
    assert told == {name: type_hash(name) for name in told}


def test_foxglove_reads_every_message_with_the_definition_that_a_recording_has():
    asked = json.dumps([[definition(ros_type), payload.hex()] for _, ros_type, payload in ENCODED]).encode()
    told = json.loads(run_foxglove(SCRIPTS / "decode.cjs", asked))
    for (_, ros_type, payload), theirs in zip(ENCODED, told, strict=True):
        ours = plain(TYPES.deserialize_cdr(payload, ros_type))
        assert same(ours, theirs), ros_type


def same(ours, theirs):
    if isinstance(ours, dict):
        # Foxglove names the parts of a time as ROS 1 did.
        names = {"nsec": "nanosec"}
        theirs = {names.get(name, name): value for name, value in theirs.items()}
        return ours.keys() == theirs.keys() and all(same(ours[name], theirs[name]) for name in ours)
    if isinstance(ours, list):
        return len(ours) == len(theirs) and all(map(same, ours, theirs))
    if isinstance(ours, float | int) and isinstance(theirs, float | int):
        return ours == pytest.approx(theirs, rel=1e-9)
    return ours == theirs
