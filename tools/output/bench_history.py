"""Ratios over time: what a benchmark found is noted in one file for each, and is held against what it found before.

Times differ from machine to machine and from day to day, ratios against a reference in the same run hardly do. So they
alone are kept, and compared with those of the same machine.
"""

import math
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from lira.hal.config import MALFORMED, read_bounded
from lira.hal.errors import ConfigError, StorageError
from lira.hal.words import plural
from lira.tools.bench import Row

SPEEDS, COST = ("real_time_factor", "speedup"), "ratio"  # parts of names: more of these is better, and less of this
SETTINGS = ("filters",)  # numbers that say, as words do, which row it is
WORSE = 0.30  # of the median before
LONGEST_BYTES = 16 * 2**20


class Entry(msgspec.Struct, frozen=True):
    """One run of a benchmark, one line of its file. `ratios` go by row and field."""

    date: str
    cpu: str
    cores: int
    version: str
    ratios: dict[str, float]


def ratios(rows: Sequence[Row]) -> dict[str, float]:
    """Return what is worth comparing, by the words of its row and the name of its field."""
    found = {}
    for row in rows:
        words = [f"{value}" for field, value in row.items() if isinstance(value, str) or field in SETTINGS]
        for field, value in row.items():
            if (_is_speed(field) or COST in field) and isinstance(value, int | float) and math.isfinite(value):
                found[" ".join([*words, field])] = float(value)
    return found


def _is_speed(name: str) -> bool:
    return any(speed in name for speed in SPEEDS)


def entry(machine: dict[str, Any], version: str, rows: Sequence[Row]) -> Entry:
    """Make the line of one run. `machine` is what `describe_machine` says."""
    return Entry(machine["date"], machine["cpu"], machine["cores"], version, ratios(rows))


def worse(now: Entry, before: Sequence[Entry]) -> list[str]:
    """Say, one line each, which ratios are over 30 % worse than their median on the same machine."""
    mine = [old.ratios for old in before if (old.cpu, old.cores) == (now.cpu, now.cores)]
    lines = []
    for name, value in now.ratios.items():
        past = [old[name] for old in mine if name in old]
        if not past:
            continue
        median = statistics.median(past)
        if value < median * (1 - WORSE) if _is_speed(name) else value > median * (1 + WORSE):
            lines.append(f"{name}: {value:.3g}, and {median:.3g} in the median of {plural(len(past), 'run')} before")
    return lines


def read_history(path: Path) -> list[Entry]:
    """Read a benchmark's file, nothing if there is none. Raises `ConfigError` with the line that is none."""
    if not path.exists():
        return []
    entries = []
    for number, line in enumerate(read_bounded(path, LONGEST_BYTES).splitlines(), start=1):
        try:
            entries.append(msgspec.json.decode(line, type=Entry))
        except MALFORMED as error:
            raise ConfigError(f"{path}, line {number}: {error}", "Take the line out.") from error
    return entries


def append(path: Path, new: Entry) -> None:
    """Add a line to a benchmark's file. Raises `StorageError`."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab") as file:
            file.write(msgspec.json.encode(new) + b"\n")
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}", "Check the folder and the disk.") from error
