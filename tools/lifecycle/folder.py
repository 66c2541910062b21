"""Where what runs is written down: a folder for each robot's name, a lock that says whether it is up, and its logs.

$XDG_STATE_HOME/lira/up/NAME (by default ~/.local/state) holds `lock`, `state.json`, `heard.json` and `logs/`.
"""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

import msgspec

from lira.hal.bus.endpoint import DEFAULT_ROBOT, check_name
from lira.hal.config import load_json
from lira.hal.errors import ConfigError, StorageError
from lira.tools.lifecycle.setup import command_line

T = TypeVar("T")
LOOK_S = 0.2
REMEDY = "Set XDG_STATE_HOME to a folder of yours."


class AlreadyUpError(ConfigError):
    """Another supervisor holds the robot's name."""


def state_home() -> Path:
    """The folder of all robots that were ever up here."""
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(base) / "lira" / "up"


class StateFolder:
    """One robot's folder. Raises `ConfigError` for what is no name of a robot."""

    def __init__(self, name: str) -> None:
        check_name(name)
        self.name = name
        self.path = state_home() / name

    @property
    def logs(self) -> Path:
        """Where each process's output is."""
        return self.path / "logs"

    def log(self, process: str) -> Path:
        """The output of one process."""
        return self.logs / f"{process}.log"

    def make(self) -> None:
        """Make the folder, for this user alone. Raises `StorageError`."""
        try:
            self.logs.mkdir(mode=0o700, parents=True, exist_ok=True)
            self.path.chmod(0o700)
        except OSError as error:
            raise StorageError(f"cannot make {self.path}: {error.strerror}", REMEDY) from error

    @contextmanager
    def held(self) -> Iterator[None]:
        """Be the one supervisor of this name for as long as the block runs. Raises `AlreadyUpError`, `StorageError`."""
        self.make()
        try:
            lock = os.open(self.path / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise StorageError(f"cannot open {self.path / 'lock'}: {error.strerror}", REMEDY) from error
        try:
            if not _lock(lock):
                look, end = command_line("status", self.name), command_line("down", self.name)
                raise AlreadyUpError(f"'{self.name}' is up already", f"Look with: {look}. End it with: {end}.")
            os.truncate(lock, 0)
            os.write(lock, str(os.getpid()).encode())
            yield
            os.truncate(lock, 0)
        finally:
            os.close(lock)

    def supervisor(self) -> int | None:
        """Process id of who supervises this name now; None if nobody does."""
        try:
            lock = os.open(self.path / "lock", os.O_RDWR | os.O_CLOEXEC)
        except OSError:
            return None
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)  # shared: who looks is in nobody's way
        except BlockingIOError:
            text = os.read(lock, 32)
            return int(text) if text.isdigit() else None
        else:
            return None
        finally:
            os.close(lock)

    def write(self, file: str, value: object) -> None:
        """Put a file in its place whole. Nothing is lost with the power: it is written anew at every start."""
        path = self.path / file
        draft = path.with_name(f".{file}.{os.getpid()}")
        try:
            draft.write_bytes(msgspec.json.encode(value))
            draft.replace(path)
        except OSError as error:
            with suppress(OSError):
                draft.unlink()
            raise StorageError(f"cannot write {path}: {error.strerror}", "Free some space.") from error

    def read(self, file: str, kind: type[T]) -> T | None:
        """What is written there; None if nothing is. Raises `ConfigError` for what cannot be read."""
        path = self.path / file
        return load_json(path, kind) if path.exists() else None


def _lock(file: int) -> bool:
    """Lock a file; who only looks whether it is locked holds it for a moment."""
    until_s = time.monotonic() + LOOK_S
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > until_s:
                return False
            time.sleep(LOOK_S / 10)
        else:
            return True


def meant(name: str | None) -> str:
    """The name that is meant: the one that is said, else that of the only robot that is up here, else the usual one."""
    up = names() if name is None else [name]
    return up[0] if len(up) == 1 else DEFAULT_ROBOT


def names() -> list[str]:
    """Robots that are up on this machine, by this user."""
    home = state_home()
    found = sorted(path.name for path in home.iterdir() if path.is_dir()) if home.is_dir() else []
    return [name for name in found if StateFolder(name).supervisor() is not None]
