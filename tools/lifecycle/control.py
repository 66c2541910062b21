"""Bring a set-up up, in a supervisor that outlives who asked for it, and take it down again."""

import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import msgspec

from lira.hal.errors import LiraError, StorageError
from lira.hal.signals import stop_on_signal
from lira.tools.launch.processes import ProcessError, how_ended
from lira.tools.lifecycle import services
from lira.tools.lifecycle.folder import StateFolder
from lira.tools.lifecycle.logs import last_lines
from lira.tools.lifecycle.records import STATE, ProcessState, State
from lira.tools.lifecycle.restart import Phase
from lira.tools.lifecycle.setup import Setup
from lira.tools.lifecycle.supervisor import Supervisor

LOOK_S = 0.05
DOWN_S = 60.0
TAIL = 12
SUPERVISOR = "supervisor"
Say = Callable[[str], None]


def supervise(setup: Setup, say: Say) -> None:
    """Keep it up in this process until a signal. Raises `AlreadyUpError`, `StorageError`."""
    folder = StateFolder(setup.name)
    with stop_on_signal() as stop, folder.held(), Supervisor(setup, folder, say) as supervisor:
        supervisor.run(stop)


def bring_up(setup: Setup, say: Say) -> State:
    """Start it, say what is ready, and return once all of it runs.

    All or nothing: if a process ends before it is ready, the rest is stopped. Raises `ProcessError` then, and
    `AlreadyUpError` and `StorageError`.
    """
    folder = StateFolder(setup.name)
    folder.make()
    child = _Detached(setup, folder.log(SUPERVISOR))
    try:
        return _follow(child, folder, say)
    except BaseException:
        child.stop()
        raise


def take_down(name: str, say: Say) -> bool:
    """Stop all that is up under a name, and return whether anything was. Raises `ProcessError` if it does not end."""
    folder = StateFolder(name)
    pid = folder.supervisor()
    if pid is None:
        return _stop_services(name, say)
    with suppress(ProcessLookupError):  # it has ended just now
        os.kill(pid, signal.SIGTERM)
    said: set[str] = set()
    until_s = time.monotonic() + DOWN_S
    while folder.supervisor() == pid:
        if time.monotonic() > until_s:
            os.kill(pid, signal.SIGKILL)  # what it has started is asked to end by the system then
            raise ProcessError(f"the supervisor of '{name}' had to be killed", f"See {folder.log(SUPERVISOR)}.")
        _say_stopped(folder, said, say)
        time.sleep(LOOK_S)
    _say_stopped(folder, said, say)
    return True


def _stop_services(name: str, say: Say) -> bool:
    if services.look(name) is None:
        return False
    target = services.target_name(name)
    services.ask_systemd(["stop", target])
    say(f"{target} is stopped until the machine starts again; for good: lira deploy laptop (or robot) --remove")
    return True


def _say_stopped(folder: StateFolder, said: set[str], say: Say) -> None:
    for process in sorted(_processes(folder), key=lambda process: process.since_s):
        if process.phase is Phase.STOPPED and process.name not in said:
            said.add(process.name)
            say(f"{process.name} stopped")


def _processes(folder: StateFolder) -> tuple[ProcessState, ...]:
    state = folder.read(STATE, State)
    return () if state is None else state.processes


class _Detached:
    """The supervisor's process, in a session of its own, which goes on when this one ends."""

    def __init__(self, setup: Setup, log: Path) -> None:
        command = [sys.executable, "-m", "lira.tools.lifecycle", msgspec.json.encode(setup).decode()]
        files = [
            (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0),
            (os.POSIX_SPAWN_OPEN, 1, str(log), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600),
            (os.POSIX_SPAWN_DUP2, 1, 2),
        ]
        try:
            self.pid = os.posix_spawn(sys.executable, command, os.environ, file_actions=files, setsid=True)
        except OSError as error:
            raise StorageError(f"cannot start the supervisor: {error.strerror}", f"Its log is {log}.") from error
        self._ended: int | None = None

    def status(self) -> int | None:
        """How it ended; None while it runs."""
        if self._ended is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self._ended = os.waitstatus_to_exitcode(status) if pid else None
        return self._ended

    def stop(self) -> None:
        """Have it take everything down, and wait for that."""
        until_s = time.monotonic() + DOWN_S
        if self.status() is None:
            os.kill(self.pid, signal.SIGTERM)
        while self.status() is None and time.monotonic() < until_s:
            time.sleep(LOOK_S)


def _follow(child: _Detached, folder: StateFolder, say: Say) -> State:
    """Tell what gets ready until all of it is."""
    said: set[str] = set()
    while True:
        if (status := child.status()) is not None:
            raise _failure(folder, SUPERVISOR, how_ended(status))
        state = folder.read(STATE, State)
        if state is not None and state.pid == child.pid:
            for process in state.processes:
                if process.ended:
                    raise _failure(folder, process.name, process.ended)
                if process.phase is Phase.RUNS and process.name not in said:
                    said.add(process.name)
                    say(f"{process.name}: {process.says or process.does}")
            if state.runs:
                return state
        time.sleep(LOOK_S)


def _failure(folder: StateFolder, name: str, how: str) -> LiraError:
    log = folder.log(name)
    tail = "\n".join(f"    {line}" for line in last_lines(log, TAIL)) or "    (it wrote nothing)"
    return ProcessError(f"the {name} ended with {how} before it was ready; it wrote:\n{tail}", f"All of it: {log}")
