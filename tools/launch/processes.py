"""Child processes of a verb, a test or a bench: start one, wait until it says that it is ready, stop it for certain."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Self

from lira.hal.errors import LiraError, StorageError

STOP_SIGNALS = ((signal.SIGINT, 6.0), (signal.SIGTERM, 3.0), (signal.SIGKILL, 5.0))
POLL_S = 0.02
TAIL_LINES = 12
# Becomes the command, in a process that the system asks to end when its parent dies, however that dies. Only Linux can,
# and it goes by the thread that started the process: one that ends earlier takes the process with it.
DIES_WITH_PARENT = f"""
import ctypes, os, sys
PR_SET_PDEATHSIG = 1
ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, {signal.SIGTERM:d})
if os.getppid() == int(sys.argv[1]):
    os.execvp(sys.argv[2], sys.argv[2:])
"""


class ProcessError(LiraError):
    """A child process that did not start, was not ready in time, or ended by itself."""


def lira_command(*words: str, python: str = sys.executable) -> list[str]:
    """Return the command line of a `lira` verb in the running interpreter or another, whatever PATH says."""
    return [python, "-m", "lira.tools", *words]


def free_port() -> int:
    """Return a loopback port that is free now, for TCP and for UDP."""
    for _ in range(20):
        with (
            socket.socket(socket.AF_INET, socket.SOCK_STREAM) as tcp,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp,
        ):
            tcp.bind(("127.0.0.1", 0))
            port = int(tcp.getsockname()[1])
            with contextlib.suppress(OSError):
                udp.bind(("127.0.0.1", port))
                return port
    raise ProcessError("found no free loopback port", "Close some programs and try again.")


class ChildProcess:
    """A process with its output in a log file. Leaving its `with` block stops it, and so does the parent's death.

    It runs in a session of its own: Ctrl-C reaches the parent alone, which decides who stops first. A log that is
    `kept` is added to; `environ` is set beside what this process has.
    """

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        log: Path,
        *,
        kept: bool = False,
        environ: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.name = name
        self.log = log
        try:
            log.parent.mkdir(parents=True, exist_ok=True)
            output = log.open("ab" if kept else "wb")
        except OSError as error:
            raise StorageError(f"cannot write {log}: {error.strerror}", "Choose another folder.") from error
        with output:
            self._process = subprocess.Popen(
                dying_with_parent(command),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, "PYTHONUNBUFFERED": "1", **environ},
                start_new_session=True,
            )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def status(self) -> int | None:
        """Exit status, negative for a signal; None while it runs."""
        return self._process.poll()

    def output(self) -> str:
        """Everything it has written so far."""
        return self.log.read_text(encoding="utf-8", errors="replace")

    def tail(self) -> str:
        """Return the last lines it wrote, indented, for an error message."""
        lines = self.output().splitlines()[-TAIL_LINES:]
        return "\n".join(f"    {line}" for line in lines) or "    (it wrote nothing)"

    def wait_ready(self, text: str, timeout_s: float) -> str:
        """Wait until it has written a line with `text` and return that line.

        Raises `ProcessError` when it ends first or takes longer than `timeout_s`.
        """
        deadline_s = time.monotonic() + timeout_s
        while True:
            # Asked before reading: what a process that has ended wrote is all there.
            ended = self.status() is not None
            for line in self.output().splitlines(keepends=True):
                if text in line and line.endswith("\n"):
                    return line.rstrip("\n")
            if ended:
                raise self.failure()
            if time.monotonic() > deadline_s:
                raise ProcessError(
                    f"{self.name} was not ready after {timeout_s:.0f} s; it wrote:\n{self.tail()}",
                    f"All of it: {self.log}",
                )
            time.sleep(POLL_S)

    def wait(self, timeout_s: float) -> int | None:
        """Wait until it ends and return its exit status; None when it still runs after `timeout_s`."""
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def failure(self) -> ProcessError:
        """Describe a process that ended though it should not have."""
        return ProcessError(
            f"{self.name} ended with {how_ended(self.status())}; it wrote:\n{self.tail()}", f"All of it: {self.log}"
        )

    def signal(self, number: signal.Signals) -> None:
        """Send it a signal; nothing happens if it has ended."""
        self._process.send_signal(number)

    def stop(self) -> int:
        """End it: asked twice, then killed; every step is bounded. Returns its exit status. May be called twice."""
        for number, patience_s in STOP_SIGNALS:
            if self.status() is None:
                self.signal(number)
            status = self.wait(patience_s)
            if status is not None:
                return status
        raise ProcessError(f"{self.name} (process {self.pid}) cannot be killed", "Restart the machine.")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def how_ended(status: int | None) -> str:
    """Say what an exit status means."""
    return f"signal {signal.Signals(-status).name}" if status is not None and status < 0 else f"status {status}"


def dying_with_parent(command: Sequence[str]) -> list[str]:
    """Return the command line that ends with this process, where the system knows how and this thread stays."""
    if sys.platform != "linux" or threading.current_thread() is not threading.main_thread():
        return list(command)
    return [sys.executable, "-I", "-S", "-c", DIES_WITH_PARENT, str(os.getpid()), *command]
