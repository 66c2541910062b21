"""Requests and answers of the RPLIDAR, as bytes. Source: Slamtec's interface protocol for the A series."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from functools import reduce
from operator import xor

START = 0xA5
DESCRIPTOR_SIZE = 7


class Request(IntEnum):
    """What can be asked of the unit."""

    STOP = 0x25
    RESET = 0x40
    SCAN = 0x20
    EXPRESS_SCAN = 0x82
    INFO = 0x50
    HEALTH = 0x52
    SAMPLE_RATE = 0x59
    CONF = 0x84
    MOTOR_PWM = 0xF0
    ACC_BOARD = 0xFF


class Answer(IntEnum):
    """Types of answers, as their descriptors name them."""

    INFO = 0x04
    HEALTH = 0x06
    SAMPLE_RATE = 0x15
    CONF = 0x20
    STANDARD = 0x81
    EXPRESS = 0x82
    ULTRA = 0x84
    DENSE = 0x85
    ULTRA_DENSE = 0x86
    ACC_BOARD = 0xFF


class Conf(IntEnum):
    """Entries of the configuration, firmware 1.24 and newer."""

    MODE_COUNT = 0x70
    US_PER_SAMPLE = 0x71
    ANSWER_TYPE = 0x75
    TYPICAL_MODE = 0x7C
    MODE_NAME = 0x7F


class Health(IntEnum):
    """What the unit thinks of itself."""

    GOOD = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class Descriptor:
    """Head of an answer: bytes of one packet, and what it is. `stream`: packets follow until told to stop."""

    size: int
    stream: bool
    kind: int


@dataclass(frozen=True, slots=True)
class Info:
    """Who the unit is."""

    model: int
    firmware: tuple[int, int]
    hardware: int
    serial: str


def encode_request(request: int, payload: bytes = b"") -> bytes:
    """Frame a request; one with a payload carries its length and the xor of everything before."""
    head = bytes([START, request])
    if not payload:
        return head
    body = head + bytes([len(payload)]) + payload
    return body + bytes([reduce(xor, body)])


def encode_motor(pwm: int) -> bytes:
    """Frame the motor's duty, 0 (off) to 1023."""
    return encode_request(Request.MOTOR_PWM, struct.pack("<H", pwm))


def encode_conf(entry: Conf, mode: int | None = None) -> bytes:
    """Ask for an entry of the configuration, of one scan mode where it belongs to one."""
    return encode_request(Request.CONF, struct.pack("<I", entry) + (b"" if mode is None else struct.pack("<H", mode)))


def encode_acc_board() -> bytes:
    """Ask whether the board between the unit and the line drives the motor."""
    return encode_request(Request.ACC_BOARD, bytes(4))


def encode_express(mode: int) -> bytes:
    """Start an express scan; mode 0 is the one that every firmware knows."""
    return encode_request(Request.EXPRESS_SCAN, struct.pack("<BHH", mode, 0, 0))


def encode_descriptor(descriptor: Descriptor) -> bytes:
    """Frame the head of an answer, as the unit does."""
    return struct.pack("<BBIB", START, 0x5A, descriptor.size | descriptor.stream << 30, descriptor.kind)


def parse_descriptor(data: bytes) -> Descriptor | None:
    """Read a head of 7 bytes; None if it is none."""
    if len(data) < DESCRIPTOR_SIZE or data[0] != START or data[1] != 0x5A:
        return None
    size, kind = struct.unpack_from("<IB", data, 2)
    return Descriptor(size & 0x3FFFFFFF, bool(size >> 30), kind)


def find_answer(data: bytes, kind: Answer, size: int) -> bytes | None:
    """Find a complete single answer of a type and size in whatever came.

    None as long as there is none. What comes before it is the rest of an old stream, or noise.
    """
    head = encode_descriptor(Descriptor(size, stream=False, kind=kind))
    start = data.find(head)
    end = start + DESCRIPTOR_SIZE + size
    if start < 0 or len(data) < end:
        return None
    return data[start + DESCRIPTOR_SIZE : end]


def find_any_answer(data: bytes, kind: Answer) -> bytes | None:
    """Find a complete single answer of a type whose size is not known beforehand."""
    start = data.find(bytes([START, 0x5A]))
    while start >= 0:
        head = parse_descriptor(data[start : start + DESCRIPTOR_SIZE])
        if head is not None and head.kind == kind and not head.stream:
            body = data[start + DESCRIPTOR_SIZE : start + DESCRIPTOR_SIZE + head.size]
            return body if len(body) == head.size else None
        start = data.find(bytes([START, 0x5A]), start + 1)
    return None


def find_stream(data: bytes, kind: Answer) -> bytes | None:
    """Return what follows the head of a stream of this type; None as long as it has not come."""
    start = data.find(bytes([START, 0x5A]))
    while start >= 0:
        head = parse_descriptor(data[start : start + DESCRIPTOR_SIZE])
        if head is not None and head.stream and head.kind == kind:
            return data[start + DESCRIPTOR_SIZE :]
        start = data.find(bytes([START, 0x5A]), start + 1)
    return None


def parse_info(body: bytes) -> Info:
    """Read the 20 bytes of an INFO answer."""
    model, minor, major, hardware = body[:4]
    return Info(model, (major, minor), hardware, body[4:20].hex().upper())


def parse_health(body: bytes) -> tuple[Health, int]:
    """Read the 3 bytes of a HEALTH answer: status and error code. An unknown status is an error."""
    status, code = struct.unpack("<BH", body)
    return (Health(status) if status in set(Health) else Health.ERROR), code


def parse_sample_rate(body: bytes) -> tuple[float, float]:
    """Read the 4 bytes of a SAMPLERATE answer: seconds per sample of the standard and of the express scan."""
    standard_us, express_us = struct.unpack("<HH", body)
    return standard_us * 1e-6, express_us * 1e-6


def parse_conf(body: bytes, entry: Conf) -> bytes | None:
    """Read a CONF answer; None if it answers another question or has no value."""
    if len(body) < 5 or struct.unpack_from("<I", body)[0] != entry:
        return None
    return body[4:]


def parse_acc_board(body: bytes) -> bool:
    """Read the 4 bytes of an ACC_BOARD answer: whether the motor hears what it is told."""
    return bool(body[0] & 1)
