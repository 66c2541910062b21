"""An RPLIDAR as its line sees it: bytes in, bytes out, time handed in.

Source: Slamtec's interface protocol for the A series, and what its own client expects of a unit.
"""

import math
import struct
from collections import deque
from functools import reduce
from operator import xor

import numpy as np

from lira.sim_backend.emulators.rplidar_head import NO_SAMPLES, Distances, Head, Optics, Samples
from lira.sim_backend.emulators.rplidar_models import EXPRESS_MODE, STANDARD_MODE, Model, ScanMode
from lira.sim_backend.emulators.rplidar_streams import ENCODERS, encode_express, encode_nodes
from lira.sim_backend.polyline import Floats

SERIAL = bytes(range(0xA0, 0xB0))
BACKLOG_S = 0.05  # what the line cannot carry by then never leaves: the unit has little memory
REQUEST_S = 5.0  # half a request is forgotten after so long
BITS = 10  # of a byte on the line
UNCORRECTED = {0x85, 0x86}  # answer types whose points lie where the head looks
SLOWEST_HZ, FASTEST_HZ = 5, 15
VENDORS_PWM = 600
PROTECTED = 0x8008  # code of the error

STOP, RESET, SCAN, FORCE_SCAN, EXPRESS = 0x25, 0x40, 0x20, 0x21, 0x82
INFO, HEALTH, SAMPLE_RATE, CONF, PWM, ACC_BOARD = 0x50, 0x52, 0x59, 0x84, 0xF0, 0xFF
WITH_PAYLOAD = {EXPRESS, 0x83, CONF, 0x85, 0x90, 0xA8, PWM, ACC_BOARD}


class RplidarUnit:
    """The unit. `receive` takes what the host sent, `emit` gives what has come over the line by now."""

    def __init__(self, distances: Distances, model: Model | None = None) -> None:
        self.model = model or Model()
        self.baud = self.model.baud
        self.head = Head(self.model)
        self._optics = Optics(self.model, distances)
        self.pwm = 0
        self.failed = self.model.broken  # a health error; a reset mends it if the unit is not broken
        self.mode: ScanMode | None = None
        self._forced, self._started_s = False, -math.inf
        self._request, self._requested_s = b"", -math.inf
        self._boots_until_s = -math.inf
        self._queue: deque[tuple[float, bytes, int]] = deque()  # when it goes on the line; samples up to its end
        self._line_free_s = -math.inf
        self._began_s: float | None = None
        self._taken = self._sent = self._arrived = 0  # samples: measured, put on the line, at its end
        self._forget_samples()

    @property
    def scanning(self) -> bool:
        """Whether it streams."""
        return self.mode is not None

    @property
    def progress(self) -> tuple[float, int]:
        """When the first sample of the stream was taken, and how many have come over the line (or never will)."""
        return self._began_s or 0.0, self._arrived

    def begin(self, mode: ScanMode, pwm: int, now_s: float) -> None:
        """Scan as if it had been told to, without an answer."""
        self._turn(pwm, now_s)
        self._start(mode, now_s)

    def receive(self, data: bytes, now_s: float) -> None:
        """Obey whatever complete requests have come."""
        if now_s < self._boots_until_s:
            return
        if now_s - self._requested_s > REQUEST_S:
            self._request = b""
        self._request, self._requested_s = self._request + data, now_s
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
        """Return what has come over the line since the last time."""
        self._scan(now_s)
        came = b""
        while self._queue:
            start_s, data, samples = self._queue[0]
            count = int((now_s - start_s) * self.baud / BITS + 1e-6)
            if count <= 0:
                break
            came += data[:count]
            if count < len(data):
                self._queue[0] = start_s + count * BITS / self.baud, data[count:], samples
                break
            self._queue.popleft()
            self._arrived = samples
        return came

    def _request_size(self) -> int | None:
        if len(self._request) < 2:
            return None
        if self._request[1] not in WITH_PAYLOAD:
            return 2
        return self._request[2] + 4 if len(self._request) > 2 else None

    def _obey(self, request: int, payload: bytes, now_s: float) -> None:
        """Any request ends the scan, and is answered; the motor's is for the board beside the unit."""
        if request != PWM or self.model.pwm_ends_scan:
            self.mode = None
        if request == PWM:
            self._turn(struct.unpack("<H", payload)[0], now_s)
        elif request == RESET:
            self.failed = self.model.broken
            self._boots_until_s = now_s + self.model.reset_s
            self._queue.clear()
            self._line_free_s = self._boots_until_s
            self._send(b"RP LIDAR System.\r\nFirmware Ver %d.%02d\r\n" % self.model.firmware, now_s)
        elif request in (SCAN, FORCE_SCAN, EXPRESS):
            mode = self._express(payload[0]) if request == EXPRESS else self._mode_of(STANDARD_MODE.answer)
            if mode is not None and not self.failed:
                self._send(descriptor(mode.size, mode.answer, stream=True), now_s)
                self._start(mode, now_s, forced=request == FORCE_SCAN)
        elif request != STOP:
            self._send(self._answer(request, payload), now_s)

    def _turn(self, pwm: int, now_s: float) -> None:
        self.pwm = pwm
        self.head.tell(pwm, now_s)

    def _express(self, number: int) -> ScanMode | None:
        modes = self.model.modes
        if number == 0 or self.model.firmware < (1, 24):  # as old clients ask for it
            return self._mode_of(EXPRESS_MODE.answer)
        return modes[number] if number < len(modes) else None

    def _mode_of(self, answer: int) -> ScanMode | None:
        return next((mode for mode in self.model.modes if mode.answer == answer), None)

    def _start(self, mode: ScanMode, now_s: float, *, forced: bool = False) -> None:
        self.mode, self._forced, self._started_s, self._began_s = mode, forced, now_s, None
        self._forget_samples()

    def _forget_samples(self) -> None:
        self._taken = self._sent = self._arrived = 0
        self._queue = deque((at_s, data, 0) for at_s, data, _ in self._queue)  # of a scan before
        self._pending = NO_SAMPLES
        self._before_rad = -math.inf  # of the head, when it took the sample before

    def _answer(self, request: int, payload: bytes) -> bytes:
        major, minor = self.model.firmware
        if request == INFO:
            who = bytes([self.model.number, minor, major, self.model.hardware])
            return descriptor(20, 0x04) + who + SERIAL
        if request == HEALTH:
            status, code = (2, PROTECTED) if self.failed else (1 if self.model.warning else 0, self.model.warning)
            return descriptor(3, 0x06) + struct.pack("<BH", status, code)
        if request == SAMPLE_RATE:
            modes = self._mode_of(STANDARD_MODE.answer), self._mode_of(EXPRESS_MODE.answer)
            rates_us = [0 if mode is None else round(mode.sample_s * 1e6) for mode in modes]
            return descriptor(4, 0x15) + struct.pack("<HH", *rates_us)
        if request == CONF and self.model.firmware >= (1, 24) and len(payload) >= 4:
            entry = struct.unpack_from("<I", payload)[0]
            number = struct.unpack_from("<H", payload, 4)[0] if len(payload) >= 6 else 0
            value = self._configuration(entry, number)
            return descriptor(4 + len(value), 0x20) + struct.pack("<I", entry) + value
        if request == ACC_BOARD and self.model.has_pwm:
            return descriptor(4, ACC_BOARD) + struct.pack("<I", 1)
        return b""

    def _configuration(self, entry: int, number: int) -> bytes:
        """An entry of the unit's table; nothing for one that it does not have."""
        modes = self.model.modes
        of_all = {
            0x01: struct.pack("<HH", 600, VENDORS_PWM),  # the speed that it wants: per minute, and the duty for it
            0x04: struct.pack("<H", 60 * SLOWEST_HZ),
            0x05: struct.pack("<H", 60 * FASTEST_HZ),
            0x60: struct.pack("<I", round(modes[0].reach_m * 256)),
            0x70: struct.pack("<H", len(modes)),
            0x7C: struct.pack("<H", self.model.typical),
        }
        if entry in of_all or number >= len(modes):
            return of_all.get(entry, b"")
        mode = modes[number]
        of_mode = {
            0x71: struct.pack("<I", round(mode.sample_s * 256e6)),
            0x74: struct.pack("<I", round(mode.reach_m * 256)),
            0x75: bytes([mode.answer]),
            0x7F: mode.name.encode() + b"\0",
        }
        return of_mode.get(entry, b"")

    def _scan(self, now_s: float) -> None:
        """Take the samples that are due, and put the packets that they complete on the line."""
        mode = self.mode
        if mode is None or not (self._forced or self.head.moving):  # the laser is off while the head stands
            return
        if self._began_s is None:
            begins_s = self._started_s if self._forced else max(self._started_s, self.head.steady_s)
            if now_s < begins_s:
                return
            self._began_s = begins_s
        beyond = 1 if mode.answer == 0x84 else 0  # such a packet has to know the next one's first distance
        taken = int((now_s - self._began_s) / mode.sample_s)
        if taken < self._sent + mode.points + beyond:
            return
        at_s: Floats = self._began_s + np.arange(self._taken, taken, dtype=np.float64) * mode.sample_s
        self._taken = taken
        theta_rad = self.head.turns(at_s) % 1.0 * math.tau
        self._pending = self._pending.then(self._optics.look(theta_rad, corrected=mode.answer not in UNCORRECTED))
        while len(self._pending.theta_rad) >= mode.points + beyond:
            packet = self._packet(mode, self._pending.part(0, mode.points + beyond))
            self._pending = self._pending.part(mode.points)
            self._sent += mode.points
            self._send(packet, self._began_s + self._sent * mode.sample_s)

    def _packet(self, mode: ScanMode, samples: Samples) -> bytes:
        theta_rad, distance_m = samples.theta_rad, samples.distance_m
        if mode.answer == 0x81:
            starts = np.diff(theta_rad, prepend=self._before_rad) < -math.pi
            self._before_rad = float(theta_rad[-1])
            return encode_nodes((theta_rad - samples.behind_rad) % math.tau, distance_m, starts)
        first = self._sent == 0
        if mode.answer == 0x82:
            return encode_express(theta_rad[:1], distance_m[None], first, samples.behind_rad[None])
        return ENCODERS[mode.answer](theta_rad[:1], distance_m[None], first)

    def _send(self, data: bytes, ready_s: float) -> None:
        """Put bytes on the line once it is free; a packet that would come too late is dropped."""
        start_s = max(ready_s, self._line_free_s)
        if data and (self.mode is None or start_s - ready_s <= BACKLOG_S):
            self._queue.append((start_s, data, self._sent))
            self._line_free_s = start_s + len(data) * BITS / self.baud


def descriptor(size: int, kind: int, *, stream: bool = False) -> bytes:
    """Head of an answer."""
    return b"\xa5\x5a" + struct.pack("<IB", size | (0x40000000 if stream else 0), kind)
