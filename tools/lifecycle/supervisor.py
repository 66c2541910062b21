"""Starts what a set-up needs, in its order; starts again what dies or hangs, after a pause; stops it all in the end.

One thread, which also is the parent of all processes: they end when it does, however that is. Each has a socket on
which it says that it is ready and alive, as systemd's services do.
"""

import contextlib
import os
import select
import shutil
import signal
import socket
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self

from lira.hal.errors import LiraError
from lira.tools.launch.notify import ALIVE, READY, SOCKET, WATCHDOG
from lira.tools.launch.processes import ChildProcess, how_ended
from lira.tools.lifecycle.folder import StateFolder
from lira.tools.lifecycle.records import STATE, ProcessState, State
from lira.tools.lifecycle.restart import Phase, Restarts
from lira.tools.lifecycle.setup import Setup
from lira.tools.lifecycle.table import Process, rows

LOOK_S = 0.1
MOST_LOG_BYTES = 4 * 2**20
LONGEST_NOTE, MOST_NOTES = 4096, 64  # bytes, and so many at a look
LONGEST_FOLDER = 64  # the path of a socket has at most 107 characters
Say = Callable[[str], None]


class Supervised:
    """One process of the list: its socket, its log, and the child while there is one."""

    def __init__(self, process: Process, setup: Setup, log: Path, sockets: Path) -> None:
        self.process = process
        self.restarts = Restarts(process.patience_s)
        self.says, self.how = "", ""
        self._command = process.command(setup)
        self._log = log
        self._address = sockets / process.name
        self._child: ChildProcess | None = None
        self.ear = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.ear.setblocking(False)
        self.ear.bind(str(self._address))

    @property
    def state(self) -> ProcessState:
        """As it is written down."""
        pid = None if self._child is None else self._child.pid
        each, life = self.process, self.restarts
        return ProcessState(each.name, each.does, life.phase, life.since_s, pid, life.starts, self.says, self.how)

    def look(self, now_s: float, say: Say, *, held: bool) -> None:
        """Hear it, notice its end, and start it when that is due; `held`: not yet."""
        self._hear(now_s, say)
        if self._child is not None and self.restarts.is_hung(now_s):
            say(f"{self.process.name} gives no sign of life: it is killed")
            self._child.signal(signal.SIGKILL)
            self._child.wait(LOOK_S)
        if self._child is not None and (status := self._child.status()) is not None:
            self.how, self.says, self._child = how_ended(status), "", None
            pause_s = self.restarts.ended(now_s)
            say(f"{self.process.name} ended with {self.how}; it is started again in {pause_s:g} s")
        if self._child is None and not held and self.restarts.is_due(now_s):
            self._start(now_s, say)

    def stop(self, say: Say) -> None:
        """End it for good. May be called twice."""
        if self._child is not None:
            self.how = how_ended(self._child.stop())
            self._child = None
            say(f"{self.process.name} stopped")
        self.restarts.stopped(time.monotonic())

    def close(self) -> None:
        """Hear no more of it."""
        self.ear.close()

    def trim(self) -> None:
        """Set the older part of a log aside that grows too long. Who writes to it goes on at its new end."""
        with contextlib.suppress(OSError):
            if self._log.stat().st_size > MOST_LOG_BYTES:
                shutil.copyfile(self._log, self._log.with_suffix(".log.1"))
                os.truncate(self._log, 0)

    def _start(self, now_s: float, say: Say) -> None:
        environ = {SOCKET: str(self._address), WATCHDOG: f"{self.process.patience_s * 1e6:.0f}"}
        try:
            self._child = ChildProcess(self.process.name, self._command, self._log, kept=True, environ=environ)
        except (LiraError, OSError) as error:  # no memory, no files: as if it had ended at once
            self.restarts.started(now_s)
            self.how = str(error)
            say(f"{self.process.name} cannot be started: {error}; once more in {self.restarts.ended(now_s):g} s")
            return
        self.restarts.started(now_s)

    def _hear(self, now_s: float, say: Say) -> None:
        with contextlib.suppress(BlockingIOError):
            for _ in range(MOST_NOTES):
                lines = self.ear.recv(LONGEST_NOTE).decode(errors="replace").splitlines()
                if self._child is None:
                    continue  # of one that has gone
                if READY in lines:
                    self.restarts.ready(now_s)
                    self.says = next((line.partition("=")[2] for line in lines if line.startswith("STATUS=")), "")
                    say(f"{self.process.name}: {self.says or self.process.does}")
                if ALIVE in lines:
                    self.restarts.alive(now_s)


class Supervisor:
    """All processes of one set-up. Use it as a context: leaving it stops them, drivers first and the robot last."""

    def __init__(self, setup: Setup, folder: StateFolder, say: Say) -> None:
        self._setup = setup
        self._folder = folder
        self._say = say
        self._since_s = time.monotonic()
        self._written: State | None = None
        temporary = tempfile.gettempdir()
        self._sockets = Path(
            tempfile.mkdtemp(prefix="lira-", dir=temporary if len(temporary) < LONGEST_FOLDER else "/tmp")
        )
        self._all = [Supervised(row, setup, folder.log(row.name), self._sockets) for row in rows(setup)]

    def run(self, stop: threading.Event) -> None:
        """Keep all of it running until `stop` is set."""
        while not stop.is_set():
            now_s = time.monotonic()
            waits = any(each.restarts.phase is not Phase.RUNS for each in self._all if each.process.is_robot)
            for each in self._all:
                # At first the robot; who has seen it once finds it again by itself.
                each.look(now_s, self._say, held=waits and not each.process.is_robot and each.restarts.starts == 0)
                each.trim()
            self._write()
            select.select([each.ear for each in self._all], [], [], LOOK_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.ExitStack() as ends:  # whatever one of them fails with, the others are stopped
            ends.callback(shutil.rmtree, self._sockets, ignore_errors=True)
            for each in self._all:
                ends.callback(each.close)
                ends.callback(self._write)
                ends.callback(each.stop, self._say)

    def _write(self) -> None:
        state = State(self._setup, os.getpid(), self._since_s, tuple(each.state for each in self._all))
        if state == self._written:
            return
        try:
            self._folder.write(STATE, state)
        except LiraError as error:  # a full disk stops no robot: who asks sees what was so before
            self._say(str(error))
        self._written = state
