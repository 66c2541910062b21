"""rosserial's framing, as bytes: `FF FE | length | its check | topic | payload | check of both`."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from string import hexdigits

SYNC = b"\xff\xfe"
HEAD_SIZE = 7
# The board's buffers hold no more, and a longer frame from it is none.
LARGEST_PAYLOAD = 512
FIRST_TOPIC = 100  # ids below have a meaning of their own
MD5_SIZE = 32


class Id(IntEnum):
    """Topics with a meaning of their own; the others are announced by the board."""

    PUBLISHER = 0  # the board tells of a topic it publishes; empty from the host: tell of all
    SUBSCRIBER = 1
    SERVICE_ANSWERS = 2
    SERVICE_REQUESTS = 3
    LOG = 7
    TIME = 10
    STOP = 11


@dataclass(frozen=True, slots=True)
class Frame:
    """One message, not yet decoded."""

    topic: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Parsed:
    """Frames in the order they came; `consumed` bytes are done with, `lost` of them made no sense."""

    frames: list[Frame]
    consumed: int
    lost: int


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """How the board announces a topic (rosserial_msgs/TopicInfo)."""

    topic: int
    name: str
    kind: str
    md5: str
    buffer_size: int


def encode_frame(topic: int, payload: bytes = b"") -> bytes:
    """Frame a payload of up to 512 bytes."""
    if len(payload) > LARGEST_PAYLOAD:
        raise ValueError(f"{len(payload)} bytes are more than the board's buffer holds")
    size, number = struct.pack("<H", len(payload)), struct.pack("<H", topic)
    return SYNC + size + _check(size) + number + payload + _check(number + payload)


def encode_time(now_s: float) -> bytes:
    """Answer the board's question for the time; non-negative seconds."""
    sec, nsec = divmod(round(now_s * 1e9), 1_000_000_000)
    return encode_frame(Id.TIME, struct.pack("<II", sec & 0xFFFFFFFF, nsec))


def parse_frames(buffer: bytes) -> Parsed:
    """Read every complete frame. What is left over has to be handed in again with what comes next."""
    frames: list[Frame] = []
    at = lost = 0
    while True:
        start = buffer.find(SYNC, at)
        if start < 0:
            start = len(buffer) - buffer.endswith(SYNC[:1])
        start = max(start, at)
        lost += start - at
        at = start
        if len(buffer) - at < HEAD_SIZE:
            break
        size = int.from_bytes(buffer[at + 2 : at + 4], "little")
        plausible = size <= LARGEST_PAYLOAD and _check(buffer[at + 2 : at + 4])[0] == buffer[at + 4]
        end = at + HEAD_SIZE + size + 1
        if plausible and len(buffer) < end:
            break
        body = buffer[at + 5 : end - 1]
        if plausible and _check(body)[0] == buffer[end - 1]:
            frames.append(Frame(int.from_bytes(body[:2], "little"), body[2:]))
            at = end
        else:
            lost += 1
            at += 1
    return Parsed(frames, at, lost)


def parse_topic_info(payload: bytes) -> TopicInfo:
    """Read an announcement. Raises `ValueError` if it is none."""
    try:
        (topic,) = struct.unpack_from("<H", payload)
        at, words = 2, []
        for _ in range(3):
            (size,) = struct.unpack_from("<I", payload, at)
            at += 4 + size
            if at > len(payload):
                raise ValueError("a string is longer than its message")
            words.append(payload[at - size : at].decode("ascii"))
        (buffer_size,) = struct.unpack_from("<i", payload, at)
    except struct.error as error:
        raise ValueError(str(error)) from error
    name, kind, md5 = words
    if topic < FIRST_TOPIC or len(md5) != MD5_SIZE or set(md5) - set(hexdigits) or not (name + kind).isprintable():
        raise ValueError(f"'{name}' has the id {topic} and the MD5 '{md5}'")
    return TopicInfo(topic, name, kind, md5, buffer_size)


def parse_answer(payload: bytes) -> tuple[str, int]:
    """Read an answer of `config`: data and result. Raises `ValueError` if it is none."""
    if len(payload) < 5 or int.from_bytes(payload[:4], "little") != len(payload) - 5:
        raise ValueError(f"{len(payload)} bytes are no answer")
    return payload[4:-1].decode("utf-8", "replace"), payload[-1]


def encode_strings(*texts: str) -> bytes:
    """Pack strings as ROS does: length and bytes."""
    return b"".join(struct.pack("<I", len(data)) + data for data in (text.encode() for text in texts))


def _check(data: bytes) -> bytes:
    return bytes([255 - sum(data) % 256])


ASK_TOPICS = encode_frame(Id.PUBLISHER)
