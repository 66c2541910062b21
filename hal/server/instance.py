"""One HAL server per robot name and user of a machine."""

import fcntl
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from lira.hal.errors import BusError


@contextmanager
def only_instance(robot: str) -> Iterator[None]:
    """Hold a robot's name while the block runs; the kernel lets go of it when the process dies, however it dies.

    The file that stands for it is in a folder of this user's, so that nobody else can hold it, and goes with the block.
    Raises `BusError` if another process holds it.
    """
    path = _folder() / f"{robot}.lock"
    try:
        lock = _lock(path)
    except BlockingIOError:
        raise BusError(
            f"a robot named '{robot}' already runs on this machine ({path} is locked)",
            "Stop it, or give this one another name: --name, and --listen with another port.",
        ) from None
    except OSError as error:
        raise BusError(f"cannot lock {path}: {error.strerror}", _REMEDY) from error
    with lock:
        try:
            yield
        finally:
            with suppress(OSError):  # while it is locked still, so that nobody else's goes
                path.unlink()


_REMEDY = "Remove it, or set TMPDIR to a folder of yours."


def _folder() -> Path:
    """Where this user's locks are. Raises `BusError` for one that others may write to."""
    folder = Path(tempfile.gettempdir()) / f"lira-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise BusError(f"cannot make {folder}: {error.strerror}", _REMEDY) from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise BusError(f"others may write to {folder}", _REMEDY)
    return folder


def _lock(path: Path) -> BinaryIO:
    """Open and lock the file that has this name; one that another process has just removed does not count."""
    while True:
        file = path.open("ab")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                    return file
        except OSError:
            file.close()
            raise
        file.close()
