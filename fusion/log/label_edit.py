"""A log of labels, edited without losing any: labels are taken back, or learned again, and two logs become one.

What is taken back stays in the log; a correction behind it says that it is not learned any more. Nothing is written to
a log that is damaged, or that a learner has open.
"""

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from lira.fusion.log.label_file import Demonstration, Format, read_format
from lira.fusion.log.label_log import read_demonstrations, read_records
from lira.fusion.log.label_salvage import lock, survey
from lira.fusion.preprocess import Features
from lira.hal.config import open_regular
from lira.hal.errors import ConfigError, StorageError
from lira.hal.messages import Driver

PAUSE_S = 1.0  # two decisions of the slowest robot; a hand that was off for so long has come back


def read_heads(path: Path) -> list[Demonstration]:
    """All labels of a log without what was seen: a million of them fit into memory. Raises as `read_demonstrations`."""
    return [replace(label, features=Features()) for label in read_demonstrations(path)]


def last_intervention(labels: Sequence[Demonstration]) -> list[int]:
    """Numbers of the stored labels of the last time the human drove and any was stored; none if there was none.

    A label's number is its place in the log, from 0. The human's labels are of one intervention while they follow each
    other in one run and lap, no expert's was stored between them, and none came later than `PAUSE_S` after the last.
    """
    interventions: list[list[int]] = [[]]
    last: Demonstration | None = None
    for number, label in enumerate(labels):
        if label.source != Driver.HUMAN:
            last = None if label.stored else last
            continue
        if last is None or (label.run, label.lap) != (last.run, last.lap) or label.stamp_s > last.stamp_s + PAUSE_S:
            interventions.append([])
        interventions[-1] += [number] if label.stored else []
        last = label
    return next((numbers for numbers in reversed(interventions) if numbers), [])


def correct(path: Path, numbers: Sequence[int], *, stored: bool) -> list[Demonstration]:
    """Take labels back by their numbers, or have them learned again. Returns those with which that changed anything.

    Raises `ConfigError` for a number that no label has, `StorageError` for a log that is damaged, in use or full.
    """
    with _appending(path) as (file, form):
        wanted, count, chosen = set(numbers), 0, []
        for number, label in enumerate(read_demonstrations(path)):
            count += 1
            if number in wanted:
                chosen.append(label)
        if len(chosen) < len(wanted):
            wrong = next(number for number in sorted(wanted) if not 0 <= number < count)
            raise ConfigError(f"{path} has no label {wrong}", f"They go from 0 to {count - 1}.")
        changed = [label for label in chosen if (label.undone if stored else label.stored)]
        _append(file, path, b"".join(form.encode(_correction(label, stored)) for label in changed))
    return changed


def merge(one: Path, other: Path, to: Path) -> tuple[int, int]:
    """Write the labels of two logs of one robot into a new one, those of the second as later runs.

    A label that is in both, since one log goes on where the other was copied, is kept once. Returns how many labels
    there are, and how many were in both. Raises `StorageError` for logs of two kinds, and where `to` cannot be made.
    """
    form, second = _whole(one), _whole(other)
    if form != second:
        raise StorageError(f"{one} and {other} are of different robots", "Merge logs of one robot and its features.")
    known, later = set[bytes](), 0
    for record in read_records(one):
        known.add(_digest(form, record))
        later = max(later, record.run + 1)
    shared = {record.run for record in read_records(other) if _digest(form, record) in known}
    count = both = 0
    try:
        with to.open("xb") as file:
            file.write(form.header())
            for record in read_records(one):
                file.write(form.encode(record))
                count += not record.correction
            for record in read_records(other):
                if _digest(form, record) in known:
                    both += not record.correction
                    continue
                file.write(form.encode(record if record.run in shared else replace(record, run=record.run + later)))
                count += not record.correction
            file.flush()
            os.fsync(file.fileno())
    except FileExistsError as error:
        raise StorageError(f"{to} is there already", "Give another name: nothing is written over.") from error
    except OSError as error:
        with suppress(OSError):
            to.unlink()
        raise StorageError(f"cannot write {to}: {error.strerror}", "Free some space, or give another place.") from error
    return count, both


def _digest(form: Format, record: Demonstration) -> bytes:
    return hashlib.blake2b(form.encode(record), digest_size=16).digest()


def _correction(label: Demonstration, stored: bool) -> Demonstration:
    return replace(label, stored=stored, correction=True)


@contextmanager
def _appending(path: Path) -> Iterator[tuple[int, Format]]:
    """Open a whole log that nobody else writes to."""
    try:
        file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_NONBLOCK)
    except OSError as error:
        raise StorageError(f"cannot open {path}: {error.strerror}", "Check the path.") from error
    try:
        lock(file, path)
        yield file, _whole(path)
    finally:
        os.close(file)


def _whole(path: Path) -> Format:
    """Return the format of a log in which nothing is damaged. Raises `StorageError`."""
    try:
        with open_regular(path) as file:
            form = read_format(file, path)
            found = survey(file, form, file.tell())
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}", "Check the path.") from error
    if found.words():
        raise StorageError(f"{path} is damaged: {found.words()}", f"Mend it first: lira labels check {path} --repair")
    return form


def _append(file: int, path: Path, data: bytes) -> None:
    """Write all of it to the disk, or nothing. Raises `StorageError`."""
    end, written = os.fstat(file).st_size, 0
    try:
        while written < len(data):
            written += os.write(file, data[written:])
        os.fsync(file)
    except OSError as error:
        os.ftruncate(file, end)
        raise StorageError(f"cannot write to {path}: {error.strerror}", "Free some space on that disk.") from error
