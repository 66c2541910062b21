"""One HAL server per robot name and machine."""

import fcntl
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
    path = Path(tempfile.gettempdir()) / f"lira-{robot}.lock"
    try:
        # Only read, and made only if it is missing: then another user's left-over does no harm.
        if not path.exists():
            path.touch(mode=0o644)
        lock = path.open("rb")
    except OSError as error:
        remedy = "Remove it, or set TMPDIR to a folder of yours."
        raise BusError(f"cannot open {path}: {error.strerror}", remedy) from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BusError(
                f"a robot named '{robot}' already runs on this machine ({path} is locked)",
                "Stop it, or give this one another name.",
            ) from None
        yield
