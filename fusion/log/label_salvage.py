"""What to do about a damaged demonstration log: all whole records are found, and a clean file takes its place.

Where a record should be and is none, the next place is looked for at which one is sealed and makes sense, byte by byte:
bytes that were lost, added or overwritten cost the records they hit and no other. The damaged file is kept.
"""

import fcntl
import itertools
import math
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from lira.fusion.log.label_file import Demonstration, Format, read_format
from lira.hal.errors import StorageError
from lira.hal.words import plural

BLOCK = 2**18
NEAR_BYTES = 2**24


@dataclass(frozen=True, slots=True)
class Damage:
    """Bytes of a log that are no label: where they begin, and how many."""

    at: int
    length: int


@dataclass(frozen=True, slots=True)
class Survey:
    """What was found in a log: where its records begin, the whole labels and their newest run, and what is no label.

    `corrections` say anew of labels whether they are stored, and are not counted among them.
    `torn_bytes` at the end of the file are the rest of a write that did not end, and zeros behind it; without them
    there is nothing behind byte `end`.
    """

    form: Format
    begin: int = 0
    count: int = 0
    newest_run: int = -1
    damages: tuple[Damage, ...] = ()
    end: int = 0
    torn_bytes: int = 0
    corrections: int = 0

    @property
    def lost_bytes(self) -> int:
        """All bytes that are no label, without the torn ones."""
        return sum(damage.length for damage in self.damages) - self.torn_bytes

    def words(self) -> str:
        """What is wrong with it, in one line; empty if nothing is."""
        torn = f"at its end: {plural(self.torn_bytes, 'byte')} of a label that was not written to its end"
        broken = self.damages[:-1] if self.torn_bytes else self.damages
        if not broken:
            return torn if self.torn_bytes else ""
        places = ", ".join(str(damage.at) for damage in broken[:3]) + (", ..." if len(broken) > 3 else "")
        return f"{plural(self.lost_bytes, 'byte')} cannot be read (at byte {places})" + (
            f", and {torn}" if self.torn_bytes else ""
        )


def pieces(file: BinaryIO, form: Format, at: int) -> Iterator[tuple[bytes, Demonstration] | Damage]:
    """Go through a log from byte `at` on: whole records, and the damage between and behind them.

    The header of a log that was appended to this one is neither.
    """
    file.seek(at)
    while data := file.read(form.record_bytes):
        record = form.decode(data)
        if record is not None:
            yield data, record
            at += len(data)
        elif data.startswith(form.header()):
            at += len(form.header())
            file.seek(at)
        else:
            found = _next_record(file, form, at + 1)
            end = file.seek(0, os.SEEK_END) if found is None else found
            yield Damage(at, end - at)
            at = end
            file.seek(at)


def survey(file: BinaryIO, form: Format, begin: int) -> Survey:
    """Go through all of a log whose records begin at byte `begin`."""
    count, corrections, newest_run, end = 0, 0, -1, begin
    damages: list[Damage] = []
    for piece in pieces(file, form, begin):
        if isinstance(piece, Damage):
            damages.append(piece)
            end = piece.at + piece.length
        else:
            correction, newest_run = piece[1].correction, max(newest_run, piece[1].run)
            count, corrections = count + (not correction), corrections + correction
            end = file.tell()
    torn_bytes = 0
    if damages and damages[-1].at + damages[-1].length == end:
        tail = damages[-1]
        if _content_bytes(file, tail) < form.record_bytes:
            torn_bytes, end = tail.length, tail.at
    return Survey(form, begin, count, newest_run, tuple(damages), end, torn_bytes, corrections)


def lock(file: int, path: Path) -> None:
    """Keep other processes from writing to an open log. Raises `StorageError` if one does."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        remedy = "Stop the other one, or give this one another file."
        raise StorageError(f"{path} is in use by another process", remedy) from error


def heal(file: BinaryIO, found: Survey, path: Path) -> tuple[int, Path]:
    """Put a clean log with all whole records in the place of a damaged one, which stays beside it under another name.

    Returns the new log, open for appending and locked, and the damaged one's new name. At any time `path` is one of
    the two, whole. Raises `StorageError`.
    """
    draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        clean = os.open(draft, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_TRUNC, 0o644)
        try:
            lock(clean, path)
            with os.fdopen(clean, "wb", closefd=False) as out:
                out.write(found.form.header())
                whole = (piece for piece in pieces(file, found.form, found.begin) if not isinstance(piece, Damage))
                out.writelines(data for data, _ in whole)
            os.fsync(clean)
            kept = _keep(path)
            draft.replace(path)
        except BaseException:
            os.close(clean)
            draft.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise StorageError(
            f"{path} is damaged ({found.words()}) and cannot be written anew: {error.strerror}",
            "Free some space, or give another file; the damaged one was left as it is.",
        ) from error
    return clean, kept


def find_format(file: BinaryIO, path: Path, candidates: Sequence[Format]) -> tuple[Format, int]:
    """Return a log's format and where its records begin; where the header is damaged, the first that fits a record.

    Raises `StorageError` for a file in which nothing of any format is found near its beginning.
    """
    try:
        return read_format(file, path), file.tell()
    except StorageError:
        for form in candidates:
            if _next_record(file, form, 0, NEAR_BYTES) is not None:
                return form, 0
        raise


def beside(path: Path, suffix: str) -> Iterator[Path]:
    """Names beside a file for what belongs to it, in the order in which to try them."""
    yield path.with_name(f"{path.name}.{suffix}")
    for number in itertools.count(2):
        yield path.with_name(f"{path.name}.{suffix}-{number}")


def _keep(path: Path) -> Path:
    """Give a file a second name beside the first, under which it stays when the first is given away."""
    for kept in beside(path, "damaged"):
        with suppress(FileExistsError):
            try:
                os.link(path, kept)
            except FileExistsError:
                raise
            except OSError:  # not every file system has links
                with path.open("rb") as source, kept.open("xb") as copy:
                    shutil.copyfileobj(source, copy)
            return kept
    raise AssertionError  # there is no end of names


def _next_record(file: BinaryIO, form: Format, at: int, until: float = math.inf) -> int | None:
    """Where the next whole record begins, from byte `at` on and about before `until`; None if there is none."""
    while at < until:
        file.seek(at)
        block = file.read(BLOCK + form.record_bytes)
        if len(block) < form.record_bytes:
            return None
        for place in form.places(block):
            if form.decode(block[place : place + form.record_bytes]) is not None:
                return at + int(place)
        at += len(block) - form.record_bytes + 1
    return None


def _content_bytes(file: BinaryIO, damage: Damage) -> int:
    """Length of a damage without the zeros at its end."""
    content, done = 0, 0
    file.seek(damage.at)
    while done < damage.length and (block := file.read(min(BLOCK, damage.length - done))):
        filled = block.rstrip(b"\0")
        content = done + len(filled) if filled else content
        done += len(block)
    return content
