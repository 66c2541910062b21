"""The CORE2 on its line: find its speed, learn its topics, keep it told, and leave it still."""

import contextlib
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from lira.hal.errors import DeviceError
from lira.hal.messages import STOP, DiagnosticStatus, Twist
from lira.robot.core2 import messages
from lira.robot.core2.board import ASK_KINEMATICS, FIRMWARE, MECANUM, Board, Readings
from lira.robot.core2.contact import SILENCE_S, Contact, State
from lira.robot.core2.rosserial import ASK_TOPICS, encode_frame, parse_frames
from lira.robot.core2.watchdog import WatchdogProcess
from lira.robot.serial_port import Line
from lira.robot.settings import BaseSettings

# Firmware 0.14.3 to 0.16.2; older; UpBoard.
BAUDS = (525000, 500000, 460800)
SEND_S = 0.05
READ_S = 0.005
FRAME_S = 1.0  # a board at this speed answers with a frame by then
LEARN_S = 3.0
ASK_S = 1.0
LOST_S = 10.0
# A board that is heard may hear nothing. Its watchdog then stops it, and it would drive off by itself when the line is
# mended: so it is called so often, and lost after so long without an answer, which is four calls.
CALL_S, DEAF_S = 0.5, 0.7
# Commands go out no faster: what a board that resets does not read waits in its port (768 bytes), and there has to be
# room for the zeros of its silence behind the commands that came before it.
SPACE_S = 0.02
POWER = "Check its power switch, and that the path is the base's."
BRAKE_S = 0.3  # a wheel without power rolls on: the firmware's ramp brakes it before the power is cut
HELD_S = 0.1  # after a loss: time for the governor to see it, which then waits for a neutral command
FAREWELL = 3  # zeros, in case one gets lost


@dataclass(slots=True)
class Counts:
    """What came and what was lost, since the driver was made."""

    frames: int = 0
    lost_bytes: int = 0
    commands: int = 0
    negotiations: int = 0


class Core2:
    """Drives the base at `url` and reads it. `session` is for a `Supervisor`; the rest may be called from any thread.

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
        self._guard: WatchdogProcess | None = None
        self._held_until_s = self._sent_s = self._call_s = -math.inf
        self.baud: int | None = None
        self.counts = Counts()
        self.losses = 0  # how often the board was silent, began anew, or was stopped by the guard; only grows

    @property
    def readings(self) -> Readings:
        """The newest of everything it measures."""
        return self._board.readings

    @property
    def answers(self) -> bool:
        """Whether the board is heard and can be driven now; false while it is silent or restarts, and just after."""
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

    def diagnostics(self) -> DiagnosticStatus:
        """What the board is, how well it is heard, and how often it began anew."""
        board, counts = self._board, self.counts
        odom, battery = board.readings.odom, board.readings.battery
        values = [("device", self._url), ("baud", str(self.baud or "the line's own")), ("banner", board.banner)]
        values += [("kinematics", board.kinematics or "unknown"), ("negotiations", str(counts.negotiations))]
        values += [("losses", str(self.losses)), ("frames", str(counts.frames)), ("bytes lost", str(counts.lost_bytes))]
        values += [("messages unreadable", str(board.unreadable)), ("answers", "; ".join(board.answers[-3:]))]
        if odom is not None:
            values.append(("odometry age s", f"{time.monotonic() - odom.stamp_s:.3f}"))
        if battery is not None:
            values.append(("battery V", f"{battery.voltage_v:.2f}"))
        message = "ok"
        if board.kinematics == MECANUM:
            message = "mecanum firmware: motion to the side is not reckoned with"
        return DiagnosticStatus(0 if message == "ok" else 1, "base", message, tuple(values))

    def session(self, stop: threading.Event, begin: Callable[[], None]) -> None:
        """Open, drive until `stop` is set or the board is lost, and leave it still. Raises `DeviceError`."""
        self._board.forget()  # whatever is at this line now has announced nothing
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
            raise DeviceError(what, f"Is it the base's port? If it is and does not just boot: {FIRMWARE}")
        raise DeviceError(f"no base board answers at {self._url}", POWER)

    def _serve(self, line: Line, buffer: bytes, stop: threading.Event, begin: Callable[[], None]) -> None:
        """Talk with the board.

        A silent one gets zeros, then it is lost: from then on it is asked for its topics and told nothing else until
        it has announced itself, and stands until there is a command of later than that.
        """
        board = self._board
        self._sent_s = -math.inf
        due_s = asked_s = learning_s = looped_s = time.monotonic()
        contact, begun = Contact(due_s), False
        while not stop.is_set():
            now_s = time.monotonic()
            if now_s - looped_s > SILENCE_S:  # this thread stood still: what waits was said before, and proves nothing
                line.flush_input()
                buffer = b""
            looped_s = now_s
            before, (buffer, state) = contact.state, self._listen(line, buffer, contact, now_s)
            if before is State.SPEAKING and state is not State.SPEAKING:
                self._lose()
                due_s = now_s
            if state is State.LEARNING:
                if before is not State.LEARNING:
                    learning_s, asked_s = now_s, -math.inf
                self._check_progress(now_s - learning_s)
                if not board.ready and now_s - asked_s > ASK_S:
                    asked_s = now_s
                    line.write(ASK_TOPICS)
            elif state is State.SPEAKING and before is not State.SPEAKING:
                self._begin(line, anew=before is State.LEARNING)
                if not begun:
                    begin()
                begun = True
                due_s = looped_s = time.monotonic()
            elif now_s >= due_s or (self._news.is_set() and now_s >= self._sent_s + SPACE_S):
                now_s = self._tell(line, silent=state is State.SILENT)
                due_s = now_s + SEND_S
                if now_s < self._until_s:  # zero is sent when it is due, not with the next repetition
                    due_s = min(due_s, self._until_s)
            buffer += line.read(READ_S)

    def _listen(self, line: Line, buffer: bytes, contact: Contact, now_s: float) -> tuple[bytes, State]:
        """Let the board handle what came and send what it wants in return; returns the rest, and how it is with it."""
        board = self._board
        parsed = parse_frames(buffer)
        self.counts.lost_bytes += parsed.lost
        self.counts.frames += len(parsed.frames)
        deaf = board.unanswered_s(now_s) > DEAF_S
        read, announced, before = board.read, board.announced, contact.state
        for frame in parsed.frames:
            board.handle(frame, now_s)
        heard, told = board.read > read and not deaf, board.announced > announced
        state = contact.step(now_s, read=heard, announced=told, ready=board.ready)
        if state is State.LEARNING and before is not State.LEARNING:
            self._dismiss_guard()  # what it would write the board may have forgotten
            if not told:
                board.forget()
        answer = b"" if state is State.SILENT else board.calls(now_s)
        if answer:
            line.write(answer)
        return buffer[parsed.consumed :], state

    def _lose(self) -> None:
        """The board is silent, begins anew or is left: whatever was commanded before counts no more."""
        self.losses += self._answers  # first: who sees it lost finds it counted
        self._answers = False
        with self._lock:
            self._until_s = -math.inf

    def _check_progress(self, learning_for_s: float) -> None:
        """Raise `DeviceError` for a board that does not announce what is needed."""
        if learning_for_s > LOST_S:
            raise DeviceError(f"the base board at {self._url} fell silent", POWER)
        if learning_for_s > LEARN_S and self._board.has_announced and not self._board.ready:
            raise self._board.objection()

    def _begin(self, line: Line, *, anew: bool) -> None:
        """The board is there: `anew` it gets a guard beside it, its watchdog on, and its motors as they shall be."""
        if anew:
            self._dismiss_guard()
            self._guard = WatchdogProcess(line.fileno(), self._frame_of(STOP))
            self.counts.negotiations += 1
            self._board.forget_calls()
            self._call_s = -math.inf
            self._motors_told = None
        if self.losses:
            self._held_until_s = time.monotonic() + HELD_S
        self._answers = True

    def _dismiss_guard(self) -> None:
        if self._guard is not None:
            self._guard.close()
            self._guard = None

    def _tell(self, line: Line, *, silent: bool) -> float:
        """Send what is wanted now; zero to a board that is silent. Returns when that was."""
        self._news.clear()
        assert self._guard is not None
        if self._guard.tell():
            self.losses += 1
            self._held_until_s = time.monotonic() + HELD_S
        with self._lock:
            now_s = time.monotonic()  # not before: whoever waited for the lock would take an old command for a new one
            off, braked = self._motors_off, now_s >= self._power_until_s
            held = silent or off or now_s < self._held_until_s
            twist = self._twist if now_s < self._until_s and not held else STOP
        line.write(self._frame_of(twist))
        self._sent_s = now_s
        self.counts.commands += 1
        called = not silent and now_s >= self._call_s
        if called:
            self._call_s = now_s + CALL_S
            self._board.configure("EWCH", "1")
        if not silent and self._motors_told is not off and (braked or not off):
            self._motors_told = off
            self._board.configure("EMOT", "0" if off else "1")
        if called and self._board.kinematics is None:  # last: nothing waits for it
            self._board.configure(ASK_KINEMATICS)
        return now_s

    def _frame_of(self, twist: Twist) -> bytes:
        assert self._board.cmd_vel is not None
        return encode_frame(self._board.cmd_vel, messages.encode_twist(twist))

    def _say_farewell(self, line: Line) -> None:
        """Leave the wheels at zero, as far as the board can be reached."""
        if self._board.cmd_vel is None:
            return
        with contextlib.suppress(DeviceError):
            line.write(FAREWELL * self._frame_of(STOP))
