"""An RPLIDAR A2 as its line sees it: bytes in, bytes out, time handed in."""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import xor

import numpy as np

from lira.sim_backend.polyline import Floats

MODEL_A2M8 = 0x28
SERIAL = bytes(range(0xA0, 0xB0))
BACKLOG_S = 0.2  # samples older than this never leave: the unit has no memory
ACC_BOARD_TYPE = 0xFF

STOP, RESET, SCAN, EXPRESS = 0x25, 0x40, 0x20, 0x82
INFO, HEALTH, SAMPLE_RATE, CONF, PWM, ACC_BOARD = 0x50, 0x52, 0x59, 0x84, 0xF0, 0xFF
WITH_PAYLOAD = {EXPRESS, CONF, PWM, ACC_BOARD}

Distances = Callable[[Floats], Floats]
"""Distances in metres [n] at the unit's clockwise angles in radians [n]; 0 where nothing comes back."""


@dataclass(frozen=True, slots=True)
class ScanMode:
    """An answer type, the points of one packet, and the time of a sample."""

    answer: int
    points: int
    size: int
    sample_s: float


STANDARD_MODE = ScanMode(0x81, 1, 5, 500e-6)
EXPRESS_MODE = ScanMode(0x82, 32, 84, 250e-6)
DENSE_MODE = ScanMode(0x85, 40, 84, 62.5e-6)


@dataclass(frozen=True, slots=True)
class Model:
    """What a unit is and can. `modes` is its table of scan modes; firmware before 1.24 does not tell it."""

    firmware: tuple[int, int] = (1, 29)
    modes: tuple[ScanMode, ...] = (STANDARD_MODE, EXPRESS_MODE)
    baud: int = 115200
    rate_hz: float = 10.0
    broken: bool = False  # reports an error, even after a reset


class RplidarUnit:
    """The unit. `receive` takes what the host sent, `emit` gives what is due."""

    def __init__(self, distances: Distances, model: Model | None = None) -> None:
        self._distances = distances
        self.model = model or Model()
        self.baud = self.model.baud
        self.pwm = 0
        self.failed = self.model.broken  # a health error; a reset mends it if the unit is not broken
        self.mode: ScanMode | None = None
        self._request = b""
        self._answers = b""
        self._began_s = 0.0
        self._sent = 0

    @property
    def scanning(self) -> bool:
        """Whether it streams."""
        return self.mode is not None

    @property
    def progress(self) -> tuple[float, int]:
        """When the stream began, and how many of its samples were sent (or never will be)."""
        return self._began_s, self._sent

    def receive(self, data: bytes, now_s: float) -> None:
        """Obey whatever complete requests have come."""
        self._request += data
        while (at := self._request.find(b"\xa5")) >= 0:
            self._request = self._request[at:]
            size = self._request_size()
            if size is None or len(self._request) < size:
                return
            request, self._request = self._request[:size], self._request[size:]
            if size == 2 or reduce(xor, request) == 0:
                self._obey(request[1], request[3:-1], now_s)
        self._request = b""

    def emit(self, now_s: float) -> bytes:
        """Return the answers, and the samples that were taken since the last time."""
        answers, self._answers = self._answers, b""
        return answers + self._stream(now_s)

    def _request_size(self) -> int | None:
        if len(self._request) < 2:
            return None
        if self._request[1] not in WITH_PAYLOAD:
            return 2
        return self._request[2] + 4 if len(self._request) > 2 else None

    def _obey(self, request: int, payload: bytes, now_s: float) -> None:
        if request == STOP:
            self.mode = None
        elif request == RESET:
            self.mode, self.failed = None, self.model.broken
            self._answers += b"RP LIDAR System.\r\nFirmware Ver 1.29\r\n"
        elif request == PWM:
            self.pwm = struct.unpack("<H", payload)[0]
        elif request in (SCAN, EXPRESS):
            self._begin(STANDARD_MODE if request == SCAN else self._express(payload[0]), now_s)
        elif self.mode is None:  # a scanning unit answers no questions
            self._answer(request, payload)

    def _express(self, number: int) -> ScanMode | None:
        if number == 0:
            return EXPRESS_MODE if EXPRESS_MODE in self.model.modes else None
        return self.model.modes[number] if number < len(self.model.modes) else None

    def _begin(self, mode: ScanMode | None, now_s: float) -> None:
        if mode is None or self.failed:
            return
        self.mode, self._began_s, self._sent = mode, now_s, 0
        self._answers += descriptor(mode.size, mode.answer, stream=True)

    def _answer(self, request: int, payload: bytes) -> None:
        major, minor = self.model.firmware
        if request == INFO:
            self._answers += descriptor(20, 0x04) + bytes([MODEL_A2M8, minor, major, 5]) + SERIAL
        elif request == HEALTH:
            self._answers += descriptor(3, 0x06) + (b"\x02\x08\x80" if self.failed else b"\x00\x00\x00")
        elif request == SAMPLE_RATE:
            rates_us = [round(mode.sample_s * 1e6) for mode in (STANDARD_MODE, EXPRESS_MODE)]
            self._answers += descriptor(4, 0x15) + struct.pack("<HH", *rates_us)
        elif request == CONF and self.model.firmware >= (1, 24):
            self._answers += self._configuration(payload)
        elif request == ACC_BOARD:
            self._answers += descriptor(4, ACC_BOARD_TYPE) + b"\x01\x00\x00\x00"

    def _configuration(self, payload: bytes) -> bytes:
        entry = struct.unpack_from("<I", payload)[0]
        modes, number = self.model.modes, struct.unpack_from("<H", payload, 4)[0] if len(payload) >= 6 else 0
        value = b""
        if entry == 0x70:
            value = struct.pack("<H", len(modes))
        elif entry == 0x7C:
            value = struct.pack("<H", len(modes) - 1)
        elif entry == 0x71 and number < len(modes):
            value = struct.pack("<I", round(modes[number].sample_s * 256e6))
        elif entry == 0x75 and number < len(modes):
            value = bytes([modes[number].answer])
        return descriptor(4 + len(value), 0x20) + struct.pack("<I", entry) + value

    def _stream(self, now_s: float) -> bytes:
        mode = self.mode
        if mode is None or self.pwm == 0:  # the laser is off while the head stands
            return b""
        taken = int((now_s - self._began_s) / mode.sample_s)
        forgotten = taken - self._sent - int(BACKLOG_S / mode.sample_s)
        if forgotten > 0:
            self._sent += forgotten // mode.points * mode.points
        packets = (taken - self._sent) // mode.points
        if packets <= 0:
            return b""
        first = self._sent == 0
        number = self._sent + np.arange(packets * mode.points)
        self._sent += len(number)
        turns = np.asarray((self._began_s + number * mode.sample_s) * self.model.rate_hz, np.float64)
        theta_rad: Floats = turns % 1.0 * math.tau
        distance_m = self._distances(theta_rad)
        if mode.answer == 0x81:
            return encode_nodes(theta_rad, distance_m)
        encode = encode_express if mode.answer == 0x82 else encode_dense
        return encode(theta_rad[:: mode.points], distance_m.reshape(packets, mode.points), first)


def descriptor(size: int, kind: int, *, stream: bool = False) -> bytes:
    """Head of an answer."""
    return b"\xa5\x5a" + struct.pack("<IB", size | (0x40000000 if stream else 0), kind)


def encode_nodes(theta_rad: Floats, distance_m: Floats) -> bytes:
    """Standard nodes; the first beyond the unit's front carries S."""
    nodes = bytearray()
    before = math.inf
    for theta, distance in zip(theta_rad.tolist(), distance_m.tolist(), strict=True):
        angle = round(math.degrees(theta) * 64) % 23040
        start = theta < before - math.pi
        quality = 15 if distance > 0 else 0
        nodes += struct.pack("<BHH", quality << 2 | (1 if start else 2), angle << 1 | 1, round(distance * 4000))
        before = theta
    return bytes(nodes)


def encode_express(start_rad: Floats, distance_m: Floats, first: bool = False) -> bytes:
    """Express capsules from start angles [n] and distances [n, 32]."""
    stream = b""
    for number, (start, distances) in enumerate(zip(start_rad, distance_m, strict=True)):
        words = [round(float(distance) * 1000) << 2 for distance in distances]
        cabins = b"".join(struct.pack("<HHB", words[i], words[i + 1], 0) for i in range(0, len(words), 2))
        stream += seal(float(start), cabins, begins=first and number == 0)
    return stream


def encode_dense(start_rad: Floats, distance_m: Floats, first: bool = False) -> bytes:
    """Dense capsules from start angles [n] and distances [n, 40]."""
    bodies = np.rint(distance_m * 1000).astype("<u2")
    pairs = enumerate(zip(start_rad, bodies, strict=True))
    return b"".join(seal(float(start), body.tobytes(), begins=first and number == 0) for number, (start, body) in pairs)


def seal(start_rad: float, body: bytes, *, begins: bool = False) -> bytes:
    """Put the head on a capsule: check nibbles with the sum, start angle, S."""
    angle = round(math.degrees(start_rad) * 64) % 23040 | (0x8000 if begins else 0)
    checked = struct.pack("<H", angle) + body
    total = reduce(xor, checked)
    return bytes([0xA0 | total & 0x0F, 0x50 | total >> 4]) + checked
