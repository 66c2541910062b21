"""The CORE2 on its line: find its speed, learn its topics, keep it told, and leave it still."""

import contextlib
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from hal.errors import DeviceError
from hal.messages import STOP, Twist
from robot.core2 import messages
from robot.core2.board import FIRMWARE, Board, Readings
from robot.core2.guard import Guard
from robot.core2.rosserial import ASK_TOPICS, encode_frame, parse_frames
from robot.line import Line
from robot.settings import BaseSettings

# Firmware 0.14.3 to 0.16.2; older; UpBoard.
BAUDS = (525000, 500000, 460800)
SEND_S = 0.05
READ_S = 0.005
FRAME_S = 1.0  # a board at this speed answers with a frame by then
LEARN_S = 3.0
ASK_S = 1.0
SILENCE_S = 1.0  # then it may have been reset, and knows us no more
LOST_S = 10.0
POWER = "Check its power switch, and that the path is the base's."
BRAKE_S = 0.3  # a wheel without power rolls on: the firmware's ramp brakes it before the power is cut
HELD_S = 0.1  # after the guard has struck: time for the governor to see it, which then waits for a neutral command
FAREWELL = 3  # zeros, in case one gets lost


@dataclass(slots=True)
class Counts:
    """What came and what was lost, since the driver was made."""

    frames: int = 0
    lost_bytes: int = 0
    commands: int = 0
    negotiations: int = 0


class Core2:
    """Drives the base at `url` and reads it. `session` is for a `Keeper`; the rest may be called from any thread.

    A command is repeated at 20 Hz until there is another, and until it is `timeout_s` old at most: then it sends zero.
    """

    def __init__(self, url: str, settings: BaseSettings, timeout_s: float) -> None:
        self._url = url
        self._settings = settings
        self._timeout_s = timeout_s
        self._board = Board(settings)
        self._lock = threading.Lock()
        self._twist = STOP
        self._until_s = -math.inf
        self._news = threading.Event()
        self._motors_off = False
        self._power_until_s = -math.inf
        self._motors_told: bool | None = None
        self._answers = False
        self._guard: Guard | None = None
        self._held_until_s = -math.inf
        self.baud: int | None = None
        self.counts = Counts()
        self.losses = 0  # how often it could not be driven any more: a reset, silence, a strike of its guard

    @property
    def readings(self) -> Readings:
        """The newest of everything it measures."""
        return self._board.readings

    @property
    def answers(self) -> bool:
        """Whether the board is heard and can be driven now; false while it restarts, or just after its guard struck."""
        return self._answers and time.monotonic() >= self._held_until_s

    def drive(self, twist: Twist, decided_s: float = math.inf) -> None:
        """Set the velocity from now on; `decided_s` on the monotonic clock, or now, is what its age counts from.

        Raises `ValueError` for what is not finite: the board would obey it.
        """
        if not (math.isfinite(twist.linear_m_s) and math.isfinite(twist.angular_rad_s)):
            raise ValueError(f"{twist} is no velocity")
        with self._lock:
            changed = twist != self._twist
            self._twist, self._until_s = twist, min(decided_s, time.monotonic()) + self._timeout_s
        if changed:
            self._news.set()

    def cut_motors(self, off: bool) -> None:
        """Stop, and take the motors' power away once the wheels have braked; or give it back. In the firmware."""
        with self._lock:
            self._power_until_s = time.monotonic() + BRAKE_S
            self._motors_off = off
        self._news.set()

    def session(self, stop: threading.Event, begin: Callable[[], None]) -> None:
        """Open, drive until `stop` is set or the board is lost, and leave it still. Raises `DeviceError`."""
        line = Line(self._url, BAUDS[0])
        try:
            if stop.wait(self._settings.boot_s):
                return
            buffer = self._find_speed(line)
            self._serve(line, buffer, stop, begin)
        finally:
            self._lose()
            self._dismiss_guard()
            self._say_farewell(line)
            line.close()

    def _find_speed(self, line: Line) -> bytes:
        """Ask at each speed until a frame comes; returns the bytes that came."""
        heard = False
        for baud in BAUDS if line.has_baud else BAUDS[:1]:
            if line.has_baud:
                line.set_baud(baud)
            line.flush_input()
            line.write(ASK_TOPICS)
            buffer, until_s = b"", time.monotonic() + FRAME_S
            while (left_s := until_s - time.monotonic()) > 0.0:
                buffer += line.read(left_s)
                heard |= bool(buffer)
                if parse_frames(buffer).frames:
                    self.baud = baud if line.has_baud else None
                    return buffer
        if heard:
            what = f"what is at {self._url} is no CORE2 with ROSbot firmware"
            raise DeviceError(what, f"Is it the base's port? {FIRMWARE}")
        raise DeviceError(f"no base board answers at {self._url}", POWER)

    def _serve(self, line: Line, buffer: bytes, stop: threading.Event, begin: Callable[[], None]) -> None:
        board = self._board
        board.forget()
        heard_s = asked_s = learning_s = time.monotonic()
        due_s = -math.inf
        begun = False
        while not stop.is_set():
            now_s = time.monotonic()
            buffer, heard = self._listen(line, buffer, now_s)
            heard_s = now_s if heard else heard_s
            if now_s - heard_s > LOST_S:
                raise DeviceError(f"the base board at {self._url} fell silent", POWER)
            if now_s - heard_s > SILENCE_S:
                self._dismiss_guard()  # what it would write the board may have forgotten
                board.forget()
                learning_s = now_s
            if not board.ready:
                self._lose()
                if now_s - learning_s > LEARN_S:
                    raise DeviceError(f"the base board lacks {', '.join(board.missing) or 'config'}", FIRMWARE)
                if now_s - asked_s > ASK_S:
                    asked_s = now_s
                    line.write(ASK_TOPICS)
            elif not self._answers:
                self._begin(line)
                due_s = now_s
                if not begun:
                    begin()
                begun = True
            elif now_s >= due_s or self._news.is_set():
                self._tell(line, now_s)
                due_s = now_s + SEND_S
                if now_s < self._until_s:  # zero is sent when it is due, not with the next repetition
                    due_s = min(due_s, self._until_s)
            buffer += line.read(READ_S)

    def _listen(self, line: Line, buffer: bytes, now_s: float) -> tuple[bytes, bool]:
        """Let the board handle what came and send what it wants in return; returns the rest, and whether it spoke."""
        parsed = parse_frames(buffer)
        self.counts.lost_bytes += parsed.lost
        self.counts.frames += len(parsed.frames)
        answer = b"".join(self._board.handle(frame, now_s) for frame in parsed.frames) + self._board.calls(now_s)
        if answer:
            line.write(answer)
        return buffer[parsed.consumed :], bool(parsed.frames)

    def _begin(self, line: Line) -> None:
        """The board is ready: a guard beside it, its watchdog on, its motors as they shall be."""
        self._dismiss_guard()
        self._guard = Guard(line.fileno(), self._frame_of(STOP))
        self.counts.negotiations += 1
        self._board.configure("EWCH", "1")
        self._motors_told = None
        self._answers = True

    def _lose(self) -> None:
        self.losses += self._answers
        self._answers = False

    def _dismiss_guard(self) -> None:
        if self._guard is not None:
            self._guard.close()
            self._guard = None

    def _tell(self, line: Line, now_s: float) -> None:
        """Send what is wanted now."""
        self._news.clear()
        assert self._guard is not None
        if self._guard.tell():
            self._held_until_s = now_s + HELD_S
            self.losses += 1
        with self._lock:
            off, braked = self._motors_off, now_s >= self._power_until_s
            held = off or now_s < self._held_until_s
            twist = self._twist if now_s < self._until_s and not held else STOP
        line.write(self._frame_of(twist))
        self.counts.commands += 1
        if self._motors_told is not off and (braked or not off):
            self._motors_told = off
            self._board.configure("EMOT", "0" if off else "1")

    def _frame_of(self, twist: Twist) -> bytes:
        assert self._board.cmd_vel is not None
        return encode_frame(self._board.cmd_vel, messages.encode_twist(twist))

    def _say_farewell(self, line: Line) -> None:
        """Leave the wheels at zero, as far as the board can be reached."""
        if self._board.cmd_vel is None:
            return
        with contextlib.suppress(DeviceError):
            line.write(FAREWELL * self._frame_of(STOP))
