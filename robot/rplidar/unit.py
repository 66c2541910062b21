"""Questions to an RPLIDAR, and their answers: who it is, how it is, what it can; and how it is started and left."""

import contextlib
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass

from lira.hal.errors import DeviceError
from lira.robot.rplidar import protocol
from lira.robot.rplidar.decoders import DECODERS
from lira.robot.rplidar.protocol import Answer, Conf, Health, Info, Request
from lira.robot.rplidar.speed import CABLE, MOTOR
from lira.robot.serial_port import Line

BAUDS = (115200, 256000)
ANSWER_S = 0.5
START_S = 1.5  # until a scan says that it begins
RESET_S = 3.0
STOP_S = 0.1  # a unit that was told to stop may still send for so long
CONF_FIRMWARE = (1, 24)
STANDARD_SAMPLES_S = (500e-6, 250e-6)  # of a standard and an express scan, if the unit does not tell
SAMPLE_S = (20e-6, 2e-3)  # a sample that takes less or more was not understood
MOST_MODES = 16
FIRST_WITH_BOARD = 2  # series: the A1's motor hears nothing


@dataclass(frozen=True, slots=True)
class Mode:
    """A scan mode: how it is started, what it answers, how long a sample takes, what the unit calls it."""

    request: bytes
    answer: Answer
    sample_s: float
    name: str = ""


class Unit:
    """A unit that does not scan."""

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
        raise DeviceError(f"no lidar answers at {self._line.url}", CABLE)

    def check_health(self) -> tuple[Health, int]:
        """Return its health, good or a warning, and its code. A unit that reports an error is reset, once.

        Raises `DeviceError` if that does not mend it.
        """
        status, code = self._health() or self._unwell()
        if status is Health.ERROR:
            self._line.write(protocol.encode_request(Request.RESET))
            until_s = time.monotonic() + RESET_S
            while time.monotonic() < until_s:
                self._silence()
                found = self._health()
                if found is not None and found[0] is not Health.ERROR:
                    return found
            raise DeviceError(
                f"the lidar at {self._line.url} reports error {code:#06x}",
                "Does its head turn freely? Unplug it and plug it in again; if the error stays, the unit is broken.",
            )
        return status, code

    def hears_motor(self, info: Info) -> bool:
        """Whether the motor's speed can be set; a board that does not tell is believed to do it."""
        if info.model >> 4 < FIRST_WITH_BOARD:
            return False
        answer = self._ask(protocol.encode_acc_board(), Answer.ACC_BOARD, 4)
        return answer is None or protocol.parse_acc_board(answer)

    def start(self, info: Info, without: Collection[Answer] = ()) -> tuple[Mode, bytes]:
        """Begin to scan in the best mode that it offers and we understand; returns it, and what came of the stream.

        `without`: answer types that are not to be tried. Raises `DeviceError` if no mode begins.
        """
        for mode in self._modes(info):
            if mode.answer in without:
                continue
            rest = self.begin(mode)
            if rest is not None:
                return mode, rest
            self._silence()
        raise DeviceError(f"the lidar at {self._line.url} does not scan", f"{MOTOR} {CABLE}")

    def begin(self, mode: Mode) -> bytes | None:
        """Begin to scan, also anew; returns what came of the stream, None if the unit does not answer."""
        self._line.write(mode.request)
        return self._hear(lambda data: protocol.find_stream(data, mode.answer), START_S)

    def _modes(self, info: Info) -> list[Mode]:
        """Modes to try, best first. Old firmware does not tell; the oldest knows nothing but the standard scan."""
        rates = self._ask(protocol.encode_request(Request.SAMPLE_RATE), Answer.SAMPLE_RATE, 4)
        told = STANDARD_SAMPLES_S if rates is None else protocol.parse_sample_rate(rates)
        standard_s = told[0] if is_plausible(told[0]) else STANDARD_SAMPLES_S[0]
        express_s = told[1] if is_plausible(told[1]) else 0.0  # none
        modes = self._offered() if info.firmware >= CONF_FIRMWARE else []
        if not modes and express_s > 0.0:
            modes = [Mode(protocol.encode_express(0), Answer.EXPRESS, express_s, "Express")]
        return [*modes, Mode(protocol.encode_request(Request.SCAN), Answer.STANDARD, standard_s, "Standard")]

    def _offered(self) -> list[Mode]:
        """Every mode in the unit's table that we understand: the fastest first, of equals what the unit recommends."""
        typical = self._number(Conf.TYPICAL_MODE)
        modes: dict[int, Mode] = {}
        for number in range(min(self._number(Conf.MODE_COUNT) or 0, MOST_MODES)):
            answer, sample_us_q8 = self._number(Conf.ANSWER_TYPE, number), self._number(Conf.US_PER_SAMPLE, number)
            if answer in set(DECODERS) and sample_us_q8 is not None and is_plausible(sample_us_q8 / 256e6):
                kind = Answer(answer)
                standard = kind is Answer.STANDARD
                request = protocol.encode_request(Request.SCAN) if standard else protocol.encode_express(number)
                modes[number] = Mode(request, kind, sample_us_q8 / 256e6, self._name(number))
        order = sorted(modes, key=lambda number: (modes[number].sample_s, number != typical))
        return [modes[number] for number in order]

    def _name(self, number: int) -> str:
        text = (self._conf(Conf.MODE_NAME, number) or b"").partition(b"\0")[0].decode("ascii", "replace")
        return text if text.isprintable() else ""

    def _number(self, entry: Conf, mode: int | None = None) -> int | None:
        value = self._conf(entry, mode)
        return None if value is None else int.from_bytes(value[:4], "little")

    def _conf(self, entry: Conf, mode: int | None = None) -> bytes | None:
        heard = self._exchange(
            protocol.encode_conf(entry, mode), lambda data: protocol.find_any_answer(data, Answer.CONF)
        )
        return None if heard is None else protocol.parse_conf(heard, entry)

    def _health(self) -> tuple[Health, int] | None:
        answer = self._ask(protocol.encode_request(Request.HEALTH), Answer.HEALTH, 3)
        return None if answer is None else protocol.parse_health(answer)

    def _unwell(self) -> tuple[Health, int]:
        raise DeviceError(f"the lidar at {self._line.url} does not tell its health", CABLE)

    def _ask(self, request: bytes, kind: Answer, size: int) -> bytes | None:
        return self._exchange(request, lambda data: protocol.find_answer(data, kind, size))

    def _exchange(self, request: bytes, find: Callable[[bytes], bytes | None]) -> bytes | None:
        """Send a request and wait for what `find` finds; None if it does not come in time."""
        self._line.write(request)
        return self._hear(find, ANSWER_S)

    def _hear(self, find: Callable[[bytes], bytes | None], seconds: float) -> bytes | None:
        """Wait for what `find` finds in all that comes; None if it does not come in time."""
        heard, until_s = b"", time.monotonic() + seconds
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


def leave(line: Line, *, turning: bool) -> None:
    """End the scan, and stop the head unless it is to go on `turning`, as far as the unit can be reached."""
    with contextlib.suppress(DeviceError):
        line.write(protocol.encode_request(Request.STOP))
        if not turning:
            time.sleep(STOP_S)
            line.write(protocol.encode_motor(0))
    line.close()
