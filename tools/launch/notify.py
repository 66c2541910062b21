"""Tells whoever supervises this process that it is ready, and goes on telling that it lives: sd_notify(3) of systemd.

systemd and `lira up` speak it alike. Without a supervisor nothing is sent.
"""

import contextlib
import math
import os
import socket
import time
from collections.abc import Callable, MutableMapping
from typing import Self

SOCKET = "NOTIFY_SOCKET"
WATCHDOG = "WATCHDOG_USEC"
WATCHDOG_PID = "WATCHDOG_PID"
READY = "READY=1"
ALIVE = "WATCHDOG=1"
OFTEN = 3.0  # it tells so many times within what the supervisor waits
LONGEST = 200  # characters of a status


class Notifier:
    """One process's line to its supervisor. `alive` may be called from any thread, as often as one likes.

    `patience_s` is how long the supervisor waits for a sign of life; None if it does not.
    """

    def __init__(
        self, address: str | None, patience_s: float | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._address = None if address is None else f"\0{address[1:]}" if address.startswith("@") else address
        self._clock = clock
        self._pause_s = math.inf if patience_s is None else patience_s / OFTEN
        self._due_s = -math.inf if patience_s is not None else math.inf

    @classmethod
    def from_environment(cls, environ: MutableMapping[str, str] = os.environ) -> Self:
        """The line that the environment names; it is taken out, for it is no child's of this process."""
        address = environ.pop(SOCKET, "")
        patience, of = environ.pop(WATCHDOG, ""), environ.pop(WATCHDOG_PID, "")
        watched = patience.isdecimal() and of in ("", str(os.getpid()))
        return cls(address or None, int(patience) / 1e6 if watched else None)

    def ready(self, words: str = "") -> None:
        """Say that the process does its work from now on, and in a line how."""
        self._send(f"{READY}\nSTATUS={words.splitlines()[0][:LONGEST]}" if words else READY)

    def alive(self) -> None:
        """Say that the loop that calls this still turns. It never waits."""
        now_s = self._clock()
        if now_s >= self._due_s:
            self._due_s = now_s + self._pause_s
            self._send(ALIVE)

    def _send(self, text: str) -> None:
        if self._address is None:
            return
        with (
            contextlib.suppress(OSError),  # a supervisor that is gone or busy is no reason to stop the robot
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line,
        ):
            line.sendto(text.encode(), socket.MSG_DONTWAIT, self._address)
