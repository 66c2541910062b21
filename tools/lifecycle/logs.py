"""The words of the processes: the last of them, and what they say from now on."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO

MOST_BYTES = 256 * 2**10  # read back from the end of a log
POLL_S = 0.2


def last_lines(log: Path, count: int) -> list[str]:
    """The last lines of a log; none of one that is not there."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, file.seek(0, 2) - MOST_BYTES))
            lines = file.read().decode(errors="replace").splitlines()
    except OSError:
        return []
    return lines[-count:] if count > 0 else []


class Follower:
    """Gives the lines that are added to logs from now on, also to one that begins anew."""

    def __init__(self, logs: Sequence[Path]) -> None:
        self._logs = logs
        self._at = {log: log.stat().st_size if log.exists() else 0 for log in logs}

    def new_lines(self) -> list[tuple[str, str]]:
        """Names of processes, and what each has said since the last time."""
        return [(log.stem, line) for log in self._logs if log.exists() for line in self._read(log)]

    def _read(self, log: Path) -> list[str]:
        with log.open("rb") as file:
            if self._at[log] > file.seek(0, 2):
                self._at[log] = 0
            file.seek(self._at[log])
            return self._whole_lines(file, log)

    def _whole_lines(self, file: BinaryIO, log: Path) -> list[str]:
        read = file.read(MOST_BYTES)
        end = read.rfind(b"\n") + 1
        whole = read[:end] if end or len(read) < MOST_BYTES else read  # who never ends a line is shown all the same
        self._at[log] += len(whole)
        return whole.decode(errors="replace").splitlines()


def follow(logs: Sequence[Path], say: Callable[[str, str], None]) -> None:
    """Pass on new lines until interrupted."""
    follower = Follower(logs)
    while True:
        for name, line in follower.new_lines():
            say(name, line)
        time.sleep(POLL_S)
