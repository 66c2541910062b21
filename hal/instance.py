"""One HAL server per robot name and machine."""

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hal.errors import BusError


@contextmanager
def only_instance(robot: str) -> Iterator[None]:
    """Hold a robot's name while the block runs; the kernel lets go of it when the process dies, however it dies.

    Raises `BusError` if another process holds it.
    """
    path = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()) / f"lira-{robot}.lock"
    taken = BusError(
        f"a robot named '{robot}' already runs on this machine ({path} is locked)",
        "Stop it, or give this one another name.",
    )
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise taken from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise taken from None
    try:
        yield
    finally:
        os.close(descriptor)
