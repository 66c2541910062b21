"""What the robot under test writes down: what its wheels were given, and where it really was.

Fixed records in a file that is written through at once. The times are this machine's monotonic clock, which all
processes share.
"""

import struct
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hal.messages import Reason

_LAYOUT = struct.Struct("<Bddddd")
REASONS: tuple[Reason | None, ...] = (None, *Reason)


@dataclass(frozen=True, slots=True)
class Given:
    """The wheels were given a velocity; `age_s` is that of the command behind it, nan without one.

    `reason` is the governor's, None if it was not the governor that gave it.
    """

    time_s: float
    linear_m_s: float
    angular_rad_s: float
    age_s: float
    reason: Reason | None = None

    @property
    def moving(self) -> bool:
        """Whether it is any motion at all."""
        return self.linear_m_s != 0.0 or self.angular_rad_s != 0.0


@dataclass(frozen=True, slots=True)
class Truth:
    """Where the body was."""

    time_s: float
    x_m: float
    y_m: float
    speed_m_s: float


class JournalWriter:
    """Appends records; may be called from several threads."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("ab", buffering=0)
        self._lock = threading.Lock()

    def given(self, record: Given) -> None:
        """Note what the wheels got."""
        code = float(REASONS.index(record.reason))
        self._write(0, record.time_s, record.linear_m_s, record.angular_rad_s, record.age_s, code)

    def truth(self, record: Truth) -> None:
        """Note where it is."""
        self._write(1, record.time_s, record.x_m, record.y_m, record.speed_m_s, 0.0)

    def close(self) -> None:
        """Write no more."""
        self._file.close()

    def _write(self, kind: int, *values: float) -> None:
        with self._lock:
            self._file.write(_LAYOUT.pack(kind, *values))


def read_journal(path: Path, since_s: float) -> tuple[list[Given], list[Truth]]:
    """Return what was noted since a time."""
    given, truth = [], []
    for kind, time_s, a, b, c, code in _records(path):
        if time_s >= since_s:
            if kind == 0:
                given.append(Given(time_s, a, b, c, REASONS[int(code)]))
            else:
                truth.append(Truth(time_s, a, b, c))
    return given, truth


def _records(path: Path) -> Iterator[tuple[int, float, float, float, float, float]]:
    data = path.read_bytes()
    whole = len(data) - len(data) % _LAYOUT.size
    return _LAYOUT.iter_unpack(data[:whole])
