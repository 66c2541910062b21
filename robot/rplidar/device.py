"""The RPLIDAR on its line: bring it up, read its turns, and stop it for certain."""

import contextlib
import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lira.hal.errors import DeviceError
from lira.hal.messages import LaserScan
from lira.hal.profile import Lidar
from lira.robot.rplidar import protocol
from lira.robot.rplidar.points import PARSERS, Parser
from lira.robot.rplidar.protocol import Answer, Conf, Health, Info, Request
from lira.robot.rplidar.turn import Mounting, TurnCutter, scan_of
from lira.robot.serial_port import Line
from lira.robot.settings import LidarSettings

BAUDS = (115200, 256000)
ANSWER_S = 0.5
RESET_S = 1.0
STOP_S = 0.1  # a unit that was told to stop may still send for so long
SILENCE_S = 0.5  # a scanning unit that sends nothing for so long is lost
READ_S = 0.1
CONF_FIRMWARE = (1, 24)
STANDARD_SAMPLES_S = (500e-6, 250e-6)  # of a standard and an express scan, if the unit does not tell
SAMPLE_S = (20e-6, 2e-3)  # a sample that takes less or more was not understood
SPANS = 15  # so many capsules tell how far one spans
POWER = "Check its cable and power, and that the path is the lidar's."


@dataclass(slots=True)
class Counts:
    """What came and what was lost, since the driver was made."""

    points: int = 0
    turns: int = 0
    lost_bytes: int = 0
    dropped_turns: int = 0


@dataclass(frozen=True, slots=True)
class Mode:
    """A scan mode: how it is started, what it answers, how long a sample takes."""

    request: bytes
    answer: Answer
    sample_s: float


class RPLidar:
    """Reads turns from a unit at `url` (a serial port, or `socket://host:port`) and hands each scan to `put`.

    `session` is for a `Supervisor`. `parsers` read the streams that are understood, the best first.
    """

    def __init__(
        self,
        url: str,
        lidar: Lidar,
        settings: LidarSettings,
        put: Callable[[LaserScan], None],
        parsers: Mapping[Answer, Parser] = PARSERS,
    ) -> None:
        self._url = url
        self._lidar = lidar
        self._settings = settings
        self._put = put
        self._parsers = parsers
        self.counts = Counts()
        self.info: Info | None = None
        self.mode: Mode | None = None

    def session(self, stop: threading.Event, begin: Callable[[], None]) -> None:
        """Open, scan until `stop` is set or the unit is lost, and leave it still. Raises `DeviceError`."""
        line = Line(self._url, BAUDS[0])
        try:
            unit = Unit(line)
            self.info = unit.identify()
            unit.check_health()
            line.write(protocol.encode_motor(self._settings.motor_pwm))
            if stop.wait(self._settings.spin_up_s):
                return
            self.mode, rest = unit.start(self.info)
            self._read(line, self.mode, rest, stop, begin)
        finally:
            halt(line)

    def _read(self, line: Line, mode: Mode, rest: bytes, stop: threading.Event, begin: Callable[[], None]) -> None:
        mounting = Mounting(self._settings.yaw_offset_rad, self._settings.mirror)
        stream = Stream(self._parsers[mode.answer], mode.sample_s, TurnCutter(mounting), self._lidar, self.counts)
        heard_s = time.monotonic()
        data, begun = rest, False
        while not stop.is_set():
            now_s = time.monotonic()
            if data:
                heard_s = now_s
            for scan in stream.feed(data, now_s):
                if not begun:
                    begin()
                    begun = True
                self._put(scan)
            if now_s - heard_s > SILENCE_S:
                raise DeviceError(f"the lidar at {self._url} fell silent", POWER)
            data = line.read(READ_S)


class Stream:
    """Bytes of a scan become scans; each point has its time."""

    def __init__(self, parse: Parser, sample_s: float, cutter: TurnCutter, lidar: Lidar, counts: Counts) -> None:
        self._parse = parse
        self._sample_s = sample_s
        self._cutter = cutter
        self._lidar = lidar
        self._counts = counts
        self._buffer = b""
        self._newest_s = -np.inf
        self._spans_deg: deque[float] = deque(maxlen=SPANS)

    def feed(self, data: bytes, now_s: float) -> list[LaserScan]:
        """Take what came by `now_s`, and return the scans that it completes."""
        self._buffer += data
        usual_deg = statistics.median(self._spans_deg) if len(self._spans_deg) > SPANS // 3 else math.inf
        points = self._parse(self._buffer, usual_deg)
        self._spans_deg.extend(points.span_deg.tolist())
        self._buffer = self._buffer[points.consumed :]
        self._counts.lost_bytes += points.lost
        self._counts.points += len(points)
        # The newest sample was taken just now; time does not run back when the line delivers in bursts.
        back = points.waiting + np.arange(len(points))[::-1]
        time_s = np.maximum(now_s - back * self._sample_s, self._newest_s)
        if len(time_s):
            self._newest_s = float(time_s[-1])
        scans = []
        for turn in self._cutter.add(points.theta_rad, points.distance_m, time_s):
            scan = scan_of(turn, self._lidar)
            if scan is None:
                self._counts.dropped_turns += 1
            else:
                self._counts.turns += 1
                scans.append(scan)
        return scans


class Unit:
    """Questions to a unit that does not scan, and their answers."""

    def __init__(self, line: Line) -> None:
        self._line = line

    def identify(self) -> Info:
        """Find the speed it speaks at, silence what a killed program left running, and ask who it is."""
        heard = False
        for baud in BAUDS if self._line.has_baud else BAUDS[:1]:
            if self._line.has_baud:
                self._line.set_baud(baud)
            heard |= self._silence()
            answer = self._ask(protocol.encode_request(Request.INFO), Answer.INFO, 20)
            if answer is not None:
                return protocol.parse_info(answer)
        if heard:
            raise DeviceError(
                f"what is at {self._line.url} is no RPLIDAR", "Give the lidar's own path; see /dev/serial/by-id."
            )
        raise DeviceError(f"no lidar answers at {self._line.url}", POWER)

    def check_health(self) -> None:
        """Reset a unit that reports an error, once. Raises `DeviceError` if that does not mend it."""
        for attempt in (1, 2):
            answer = self._ask(protocol.encode_request(Request.HEALTH), Answer.HEALTH, 3)
            if answer is None:
                raise DeviceError(f"the lidar at {self._line.url} does not tell its health", POWER)
            status, code = protocol.parse_health(answer)
            if status is not Health.ERROR:
                return
            if attempt == 1:
                self._line.write(protocol.encode_request(Request.RESET))
                time.sleep(RESET_S)
                self._silence()
        raise DeviceError(
            f"the lidar at {self._line.url} reports error {code:#06x}",
            "Does its head turn freely? Unplug it and plug it in again; if the error stays, the unit is broken.",
        )

    def start(self, info: Info) -> tuple[Mode, bytes]:
        """Begin to scan in the best mode that it offers and we understand; returns it, and what came of the stream.

        Raises `DeviceError` if no mode begins.
        """
        for mode in self._modes(info):
            self._line.write(mode.request)
            rest = self._hear(lambda data, mode=mode: protocol.find_stream(data, mode.answer))  # type: ignore[misc]
            if rest is not None:
                return mode, rest
            self._silence()
        raise DeviceError(f"the lidar at {self._line.url} does not scan", "Does its motor turn? " + POWER)

    def _modes(self, info: Info) -> list[Mode]:
        """Modes to try, best first. Old firmware does not tell; the oldest knows nothing but the standard scan."""
        rates = self._ask(protocol.encode_request(Request.SAMPLE_RATE), Answer.SAMPLE_RATE, 4)
        told = STANDARD_SAMPLES_S if rates is None else protocol.parse_sample_rate(rates)
        standard_s = told[0] if is_plausible(told[0]) else STANDARD_SAMPLES_S[0]
        express_s = told[1] if is_plausible(told[1]) else 0.0  # none
        offered = self._offered() if info.firmware >= CONF_FIRMWARE else []
        modes = [mode for answer in PARSERS for mode in offered if mode.answer is answer]
        if not modes and express_s > 0.0:
            modes.append(Mode(protocol.encode_express(0), Answer.EXPRESS, express_s))
        return [*modes, Mode(protocol.encode_request(Request.SCAN), Answer.STANDARD, standard_s)]

    def _offered(self) -> list[Mode]:
        """Every mode in the unit's table that we understand."""
        modes = []
        for number in range(min(self._conf(Conf.MODE_COUNT) or 0, 16)):
            answer, sample_us_q8 = self._conf(Conf.ANSWER_TYPE, number), self._conf(Conf.US_PER_SAMPLE, number)
            if answer in set(PARSERS) and sample_us_q8 is not None and is_plausible(sample_us_q8 / 256e6):
                kind = Answer(answer)
                standard = kind is Answer.STANDARD
                request = protocol.encode_request(Request.SCAN) if standard else protocol.encode_express(number)
                modes.append(Mode(request, kind, sample_us_q8 / 256e6))
        return modes

    def _conf(self, entry: Conf, mode: int | None = None) -> int | None:
        heard = self._exchange(
            protocol.encode_conf(entry, mode), lambda data: protocol.find_any_answer(data, Answer.CONF)
        )
        return None if heard is None else protocol.parse_conf(heard, entry)

    def _ask(self, request: bytes, kind: Answer, size: int) -> bytes | None:
        return self._exchange(request, lambda data: protocol.find_answer(data, kind, size))

    def _exchange(self, request: bytes, find: Callable[[bytes], bytes | None]) -> bytes | None:
        """Send a request and wait for what `find` finds; None if it does not come in time."""
        self._line.write(request)
        return self._hear(find)

    def _hear(self, find: Callable[[bytes], bytes | None]) -> bytes | None:
        """Wait for what `find` finds in all that comes; None if it does not come in time."""
        heard, until_s = b"", time.monotonic() + ANSWER_S
        while (left_s := until_s - time.monotonic()) > 0.0:
            heard += self._line.read(left_s)
            found = find(heard)
            if found is not None:
                return found
        return None

    def _silence(self) -> bool:
        """Stop a stream and throw away what is still under way; returns whether anything was."""
        self._line.write(protocol.encode_request(Request.STOP))
        until_s = time.monotonic() + STOP_S
        heard = False
        while (left_s := until_s - time.monotonic()) > 0.0:
            heard |= bool(self._line.read(left_s))
        return heard


def is_plausible(sample_s: float) -> bool:
    """Whether a unit may take so long for a sample."""
    return SAMPLE_S[0] <= sample_s <= SAMPLE_S[1]


def halt(line: Line) -> None:
    """Leave the unit still, as far as it can be reached, and let go of the line."""
    with contextlib.suppress(DeviceError):
        line.write(protocol.encode_request(Request.STOP))
        time.sleep(STOP_S)
        line.write(protocol.encode_motor(0))
    line.close()
