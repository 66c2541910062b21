"""A pseudo-terminal with an emulated device behind it. It can be unplugged, and its line can be bad."""

import array
import contextlib
import fcntl
import os
import random
import select
import termios
import threading
import time
import tty
from pathlib import Path
from typing import Protocol

from lira.hal.errors import DeviceError

TICK_S = 0.002
READ_SIZE = 4096
JOIN_S = 2.0
# Linux's `termios2` by ioctl tells any speed, also those that `termios` has no name for: 11 words, the last is output.
TCGETS2 = 0x802C542A
TERMIOS2_WORDS = 11


class Unit(Protocol):
    """A device at the end of a line. `baud` is the speed it speaks at."""

    baud: int

    def receive(self, data: bytes, now_s: float) -> None:
        """Take what the host sent."""

    def emit(self, now_s: float) -> bytes:
        """Return what is to be sent by now."""


class Wire:
    """Runs a unit behind the link `path` in a thread of its own, from construction until `close`.

    A host at another speed gets and gives garbage. Set `loss` to lose that share of the bytes to the host; `mute` to
    cut the way to the host, and `deaf` the way from it.
    """

    def __init__(self, path: Path, unit: Unit, seed: int = 0) -> None:
        self._path = path
        self._unit = unit
        self._random = random.Random(seed)
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._ends: tuple[int, int] | None = None
        self._noise = b""
        self.loss = 0.0
        self.mute = self.deaf = False
        self.overflowed = 0  # bytes that the host did not fetch in time
        self.plug()
        self._thread = threading.Thread(target=self._run, name=f"wire-{path.name}", daemon=True)
        self._thread.start()

    def plug(self) -> None:
        """Make the terminal, and the link to it. Raises `DeviceError` if `path` is taken by something else."""
        with self._lock:
            if self._ends is not None:
                return
            ends = os.openpty()
            tty.setraw(ends[1])
            os.set_blocking(ends[0], False)
            try:
                if self._path.is_symlink():
                    self._path.unlink()
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._path.symlink_to(os.ttyname(ends[1]))
            except OSError as error:
                for end in ends:
                    os.close(end)
                raise DeviceError(f"cannot make {self._path}: {error.strerror}", "Choose another folder.") from error
            self._ends = ends

    def unplug(self) -> None:
        """Take the terminal away under the host's feet."""
        with self._lock:
            ends, self._ends = self._ends, None
            if ends is not None:
                with contextlib.suppress(FileNotFoundError):
                    self._path.unlink()
                for end in ends:
                    os.close(end)

    def disturb(self, count: int) -> None:
        """Send the host so many bytes of noise."""
        self.inject(self._random.randbytes(count))

    def inject(self, data: bytes) -> None:
        """Send the host these bytes, between two of the unit's words."""
        with self._lock:
            self._noise += data

    def close(self) -> None:
        """Unplug it for good. May be called twice."""
        self._stop.set()
        self._thread.join(JOIN_S)
        self.unplug()

    def _run(self) -> None:
        while not self._stop.wait(TICK_S):
            with self._lock:
                if self._ends is not None:
                    self._exchange(*self._ends)
                else:
                    self._unit.emit(time.monotonic())  # it goes on without its cable

    def _exchange(self, master: int, slave: int) -> None:
        now_s = time.monotonic()
        same_speed = speed(slave) == self._unit.baud
        if select.select([master], [], [], 0.0)[0]:
            data = os.read(master, READ_SIZE)
            if same_speed and not self.deaf:
                self._unit.receive(data, now_s)
        data = self._unit.emit(now_s)
        if not same_speed:
            data = self._random.randbytes(len(data) // 2)
        if self.mute:
            data = b""
        if self.loss:
            data = bytes(byte for byte in data if self._random.random() >= self.loss)
        data, self._noise = data + self._noise, b""
        try:
            sent = os.write(master, data) if data else 0
        except BlockingIOError:
            sent = 0
        self.overflowed += len(data) - sent


def speed(terminal: int) -> int:
    """Speed of a terminal in baud."""
    words = array.array("I", [0] * TERMIOS2_WORDS)
    try:
        fcntl.ioctl(terminal, TCGETS2, words)
    except OSError:  # not Linux: only the speeds with a name
        return int(termios.tcgetattr(terminal)[5])
    return words[TERMIOS2_WORDS - 1]
