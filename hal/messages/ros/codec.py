"""The codec: messages of `hal.messages` as ROS 2 CDR, and back.

Whatever the bytes, `decode` returns a message within the bounds of its type (`bounds.py`) or raises `CodecError`.
"""

import struct
from typing import Any, TypeVar

import msgspec
from rosbags.serde import SerdeError

from lira.hal.errors import CodecError
from lira.hal.messages.bounds import check
from lira.hal.messages.ros import description, learning, motion, operation, sensing
from lira.hal.messages.ros.types import TYPES, Codec

M = TypeVar("M")
PADDED_BYTES = 16

# How each message becomes a ROS message, and back.
CODECS: dict[type, Codec] = motion.CODECS | sensing.CODECS | operation.CODECS | learning.CODECS | description.CODECS

# rosbags raises its own error for what it checks and these for what it does not; a value that no enum or array
# shape takes ends in the same family.
MALFORMED = (
    SerdeError,
    struct.error,
    ValueError,
    TypeError,
    IndexError,
    KeyError,
    AttributeError,
    OverflowError,
    AssertionError,
)


def ros_type_of(kind: type) -> str:
    """Name of the ROS type that a message travels as, e.g. `sensor_msgs/msg/LaserScan`."""
    return CODECS[kind].ros_type


def fixed_bytes(example: object) -> int:
    """The longest payload of a type that has no texts or sequences, with what DDS may pad it with."""
    return -(-len(encode(example)) // PADDED_BYTES) * PADDED_BYTES


def encode(message: object) -> bytes:
    """Serialise a message of `hal.messages`. Raises `CodecError` for what ROS cannot hold, such as a stamp of nan."""
    codec = CODECS[type(message)]
    try:
        return bytes(TYPES.serialize_cdr(codec.to_ros(message), codec.ros_type))
    except MALFORMED as error:
        raise CodecError(f"cannot encode {type(message).__name__}: {error}") from error


def decode(kind: type[M], data: bytes) -> M:
    """Read a message of `kind` from CDR of either byte order. Raises `CodecError`, and nothing else."""
    codec = CODECS[kind]
    try:
        message: M = codec.from_ros(TYPES.deserialize_cdr(data, codec.ros_type))
        check(message)
    except MALFORMED as error:
        raise CodecError(f"{len(data)} bytes are no {codec.ros_type}: {error}") from error
    return message


def decode_json(kind: Any, data: bytes) -> Any:
    """Read a value of `kind`, with the bounds in its type, from JSON. Raises `CodecError`, and nothing else."""
    try:
        return msgspec.json.decode(data, type=kind)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise CodecError(f"{len(data)} bytes are not what was expected: {error}") from error
