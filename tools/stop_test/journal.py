"""What the processes under test write down: what was sent and by whom, what arrived, what the wheels got.

Fixed records in a folder with one file for each writer, written through at once. The times are this
machine's monotonic clock, which all processes share. Nothing in it is taken from what the product says about itself,
except the governor's reasons (`Said`).
"""

import struct
import threading
from dataclasses import dataclass, field
from pathlib import Path

from lira.hal.messages import Reason

SUFFIX = ".bin"
_LAYOUT = struct.Struct("<Bdddd")
REASONS = tuple(Reason)
MARK_RAD_S = 1e-3  # what turns more slowly than this only carries a sender's mark
SENDERS = ("driver", "hand", "fusion", "liar", "intruder", "joystick")


def moves(linear_m_s: float, angular_rad_s: float) -> bool:
    """Whether the wheels turn by this velocity; what is not a number counts as if."""
    return not (linear_m_s == 0.0 and abs(angular_rad_s) < MARK_RAD_S)


@dataclass(frozen=True, slots=True)
class Sent:
    """Somebody put a command on the bus."""

    time_s: float
    who: str
    linear_m_s: float
    angular_rad_s: float

    @property
    def moving(self) -> bool:
        """Whether it asks for any motion at all."""
        return self.linear_m_s != 0.0 or self.angular_rad_s != 0.0


@dataclass(frozen=True, slots=True)
class Heard:
    """A command reached the robot, whatever becomes of it there."""

    time_s: float
    linear_m_s: float
    angular_rad_s: float


@dataclass(frozen=True, slots=True)
class Wheels:
    """The wheels were given a velocity. A motion counts from when it was decided, a zero from when it was done."""

    time_s: float
    linear_m_s: float
    angular_rad_s: float

    @property
    def moving(self) -> bool:
        """Whether it is any motion at all."""
        return moves(self.linear_m_s, self.angular_rad_s)


@dataclass(frozen=True, slots=True)
class Said:
    """The governor let through motion or zero, and why."""

    time_s: float
    reason: Reason
    moving: bool


@dataclass(frozen=True, slots=True)
class Truth:
    """Where the body was."""

    time_s: float
    x_m: float
    y_m: float
    speed_m_s: float


@dataclass(frozen=True, slots=True)
class Stalled:
    """The machine let a process that only slept wait so long, up to a time."""

    time_s: float
    stall_s: float


Record = Stalled | Sent | Heard | Wheels | Said | Truth


@dataclass(frozen=True, slots=True)
class Journal:
    """Everything that was noted, by kind, in order of time."""

    sent: list[Sent] = field(default_factory=list)
    heard: list[Heard] = field(default_factory=list)
    wheels: list[Wheels] = field(default_factory=list)
    said: list[Said] = field(default_factory=list)
    truth: list[Truth] = field(default_factory=list)
    stalled: list[Stalled] = field(default_factory=list)


class JournalWriter:
    """Appends records to one writer's file of the journal in `folder`; may be called from several threads."""

    def __init__(self, folder: Path, writer: str) -> None:
        self._file = (folder / f"{writer}{SUFFIX}").open("ab", buffering=0)
        self._lock = threading.Lock()

    def note(self, record: Record) -> None:
        """Write one down."""
        with self._lock:
            self._file.write(_pack(record))

    def close(self) -> None:
        """Write no more."""
        self._file.close()


class JournalReader:
    """Reads what all writers have noted in `folder`, which it makes, since the last `skip`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True)
        self._starts: dict[Path, int] = {}

    def skip(self) -> None:
        """Leave out what has been noted up to now."""
        self._starts = {path: path.stat().st_size // _LAYOUT.size for path in self._files()}

    def read(self) -> Journal:
        """Return what was noted since."""
        return _journal([record for path in self._files() for record in self._records(path)])

    def _files(self) -> list[Path]:
        return sorted(self.folder.glob(f"*{SUFFIX}"))

    def _records(self, path: Path) -> list[Record]:
        with path.open("rb") as file:
            file.seek(self._starts.get(path, 0) * _LAYOUT.size)
            data = file.read()
        whole = len(data) - len(data) % _LAYOUT.size
        return [_unpack(*values) for values in _LAYOUT.iter_unpack(data[:whole])]


def _journal(records: list[Record]) -> Journal:
    journal = Journal()
    for record in sorted(records, key=lambda one: one.time_s):
        match record:
            case Sent():
                journal.sent.append(record)
            case Heard():
                journal.heard.append(record)
            case Wheels():
                journal.wheels.append(record)
            case Said():
                journal.said.append(record)
            case Truth():
                journal.truth.append(record)
            case Stalled():
                journal.stalled.append(record)
    return journal


def _pack(record: Record) -> bytes:
    match record:
        case Sent(time_s, who, linear, angular):
            return _LAYOUT.pack(0, time_s, linear, angular, SENDERS.index(who))
        case Heard(time_s, linear, angular):
            return _LAYOUT.pack(1, time_s, linear, angular, 0.0)
        case Wheels(time_s, linear, angular):
            return _LAYOUT.pack(2, time_s, linear, angular, 0.0)
        case Said(time_s, reason, moving):
            return _LAYOUT.pack(3, time_s, REASONS.index(reason), moving, 0.0)
        case Truth(time_s, x_m, y_m, speed_m_s):
            return _LAYOUT.pack(4, time_s, x_m, y_m, speed_m_s)
        case Stalled(time_s, stall_s):
            return _LAYOUT.pack(5, time_s, stall_s, 0.0, 0.0)


def _unpack(kind: int, time_s: float, a: float, b: float, c: float) -> Record:
    if kind == 0:
        return Sent(time_s, SENDERS[int(c)], a, b)
    if kind == 3:
        return Said(time_s, REASONS[int(a)], bool(b))
    if kind == 4:
        return Truth(time_s, a, b, c)
    if kind == 5:
        return Stalled(time_s, a)
    return Heard(time_s, a, b) if kind == 1 else Wheels(time_s, a, b)
