"""The demonstration log as bytes: what a record looks like, and how all whole ones are found in a damaged file.

Layout, little-endian: a header (magic, version, bins, px, profile, CRC-32), then records of one size, each with a
CRC-32 of its own. Where a record should be and is none, the next place is looked for at which one is sealed and makes
sense, byte by byte: bytes that were lost, added or overwritten cost the records they hit and no other.

The byte of flags and the number of the run were zero bits in the first logs, which read as run 0, not mirrored.
"""

import fcntl
import math
import os
import shutil
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fusion.labels import is_rest
from fusion.preprocess import from_uint8, to_uint8
from hal.errors import StorageError
from hal.messages import Action, FloatArray
from hal.profile import MAX_BINS, MAX_IMAGE_PX, RobotProfile

MAGIC = b"LIRADEMO"
VERSION = 1
LIMIT = 1.01  # actions are in [-1, 1] and ranges in [0, 1], give or take the rounding of who divided
BLOCK = 2**18
NEAR_BYTES = 2**24

_HEADER = struct.Struct("<8sHHHH")  # magic, version, bins, px, bytes of the profile's name
_FIELDS = struct.Struct("<dqHHB32sdddd")  # stamp, observation, lap, run, flags, source, action, novice's action
_FLAGS_AT, _SOURCE_AT = 20, 21
_ACTIONS_AT = (53, 61, 69, 77)
_SOURCE_BYTES = 32
_STORED, _MIRRORED = 1, 2
_MOST = 2**16 - 1  # laps and runs are not counted further
_CRC = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class Demonstration:
    """One label that was given, and whether the redundancy filter stored it.

    `source` is "human", an expert's name or "mean"; `novice` is a^N at that time; `scan` float32 [bins] and `image`
    float32 [px, px] are the features. `mirrored`: it was learned with left and right exchanged, too. `run` is which
    opening of the log it was given in, from 0; the log sets both.
    """

    stamp_s: float
    observation: int
    lap: int
    source: str
    action: Action
    novice: Action
    stored: bool
    scan: FloatArray
    image: FloatArray
    mirrored: bool = False
    run: int = 0

    @property
    def idle(self) -> bool:
        """Whether the human held the wheel and did nothing."""
        return self.source == "human" and is_rest(self.action)


@dataclass(frozen=True, slots=True)
class Format:
    """What a log holds, from its header."""

    bins: int
    px: int
    profile: str

    @classmethod
    def of(cls, profile: RobotProfile) -> "Format":
        """Return the format of a robot's logs."""
        return cls(profile.features.bins, profile.features.image_px, profile.name)

    @property
    def record_bytes(self) -> int:
        """Size of every record."""
        return _CRC.size + _FIELDS.size + 4 * self.bins + self.px**2

    def header(self) -> bytes:
        """Return the file's first bytes."""
        name = self.profile.encode()
        return _sealed(_HEADER.pack(MAGIC, VERSION, self.bins, self.px, len(name)) + name)

    def encode(self, record: Demonstration) -> bytes:
        """Raises `ValueError` for what `decode` would not take: features of another size, actions out of range."""
        source = record.source.encode()
        if record.scan.shape != (self.bins,) or record.image.shape != (self.px, self.px) or len(source) > _SOURCE_BYTES:
            raise ValueError(
                f"a label of '{record.source}' with a scan {record.scan.shape} and an image {record.image.shape} "
                f"does not fit a log of {self.bins} bins and {self.px} px"
            )
        flags = _STORED * record.stored + _MIRRORED * record.mirrored
        counts = min(record.lap, _MOST), min(record.run, _MOST)
        fields = (record.stamp_s, record.observation, *counts, flags, source, *record.action, *record.novice)
        scan = np.ascontiguousarray(record.scan, dtype="<f4").tobytes()
        data = _sealed(_FIELDS.pack(*fields) + scan + to_uint8(record.image).tobytes())
        if self.decode(data) is None:
            raise ValueError(f"a label of '{record.source}' with the actions {record.action} and {record.novice}")
        return data

    def decode(self, data: bytes) -> Demonstration | None:
        """None for bytes that are not a whole record, or a sealed one that makes no sense."""
        if len(data) != self.record_bytes or not _is_sealed(data):
            return None
        stamp_s, observation, lap, run, flags, source, *actions = _FIELDS.unpack_from(data)
        scan = np.frombuffer(data, "<f4", self.bins, _FIELDS.size).astype(np.float32)
        name = _text(source.rstrip(b"\0"))
        bounded = max(map(abs, actions)) <= LIMIT and np.abs(scan).max() <= LIMIT
        # A nan among others need not be the largest of them; in the sum it shows.
        finite = math.isfinite(stamp_s + sum(actions)) and math.isfinite(scan.sum())
        if not (name and bounded and finite and flags <= _STORED | _MIRRORED):
            return None
        gray = np.frombuffer(data, np.uint8, self.px**2, _FIELDS.size + 4 * self.bins).reshape(self.px, self.px)
        return Demonstration(
            stamp_s=stamp_s,
            observation=observation,
            lap=lap,
            source=name,
            action=(actions[0], actions[1]),
            novice=(actions[2], actions[3]),
            stored=bool(flags & _STORED),
            scan=scan,
            image=from_uint8(gray),
            mirrored=bool(flags & _MIRRORED),
            run=run,
        )

    def places(self, block: bytes) -> NDArray[np.intp]:
        """Return where in a block a record may begin: few places, so that few checksums are reckoned."""
        count = max(len(block) - self.record_bytes + 1, 0)
        data = np.frombuffer(block, np.uint8)
        likely = (data[_FLAGS_AT:][:count] <= _STORED | _MIRRORED) & (data[_SOURCE_AT:][:count] > ord(" "))
        for at in _ACTIONS_AT:  # the top byte of a number below 2
            likely &= data[at + 7 :][:count] & 0x7F <= 0x3F
        return np.flatnonzero(likely)


@dataclass(frozen=True, slots=True)
class Damage:
    """Bytes of a log that are no label: where they begin, and how many."""

    at: int
    length: int


@dataclass(frozen=True, slots=True)
class Survey:
    """What was found in a log: where its records begin, the whole ones and their newest run, and what is no label.

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

    @property
    def lost_bytes(self) -> int:
        """All bytes that are no label, without the torn ones."""
        return sum(damage.length for damage in self.damages) - self.torn_bytes

    def words(self) -> str:
        """What is wrong with it, in one line; empty if nothing is."""
        torn = f"its last {self.torn_bytes} bytes are the rest of a label that was not written to its end"
        broken = self.damages[:-1] if self.torn_bytes else self.damages
        if not broken:
            return torn if self.torn_bytes else ""
        places = ", ".join(str(damage.at) for damage in broken[:3]) + (", ..." if len(broken) > 3 else "")
        return f"{self.lost_bytes} bytes cannot be read (at byte {places})" + (
            f", and {torn}" if self.torn_bytes else ""
        )


def read_format(file: BinaryIO, path: Path) -> Format:
    """Read the header. Raises `StorageError` for a file that is no log, or whose header cannot be read."""
    start = file.read(_HEADER.size)
    if len(start) < _HEADER.size or not start.startswith(MAGIC):
        raise StorageError(f"{path} is no demonstration log", "Give the path of a log, or of a new file.")
    _, version, bins, px, name_bytes = _HEADER.unpack(start)
    if version != VERSION:
        raise StorageError(f"{path} is a log of version {version}", f"This program reads version {VERSION}.")
    rest = file.read(name_bytes + _CRC.size)
    name = _text(rest[:name_bytes])
    if not (name and _is_sealed(start + rest) and bins <= MAX_BINS and px <= MAX_IMAGE_PX):
        raise StorageError(f"the header of {path} is damaged", f"See what can be saved: lira labels check {path}")
    return Format(bins, px, name)


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
    count, newest_run, end = 0, -1, begin
    damages: list[Damage] = []
    for piece in pieces(file, form, begin):
        if isinstance(piece, Damage):
            damages.append(piece)
            end = piece.at + piece.length
        else:
            count, newest_run = count + 1, max(newest_run, piece[1].run)
            end = file.tell()
    torn_bytes = 0
    if damages and damages[-1].at + damages[-1].length == end:
        tail = damages[-1]
        if _content_bytes(file, tail) < form.record_bytes:
            torn_bytes, end = tail.length, tail.at
    return Survey(form, begin, count, newest_run, tuple(damages), end, torn_bytes)


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
    for number in range(2, _MOST):
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
    raise FileExistsError(f"too many damaged copies beside {path}")


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


def _text(data: bytes) -> str:
    """A name; empty for bytes that are none."""
    try:
        name = data.decode()
    except UnicodeDecodeError:
        return ""
    return name if name.isprintable() else ""


def _sealed(data: bytes) -> bytes:
    return data + _CRC.pack(zlib.crc32(data))


def _is_sealed(data: bytes) -> bool:
    body = data[: -_CRC.size]
    return len(data) > _CRC.size and _CRC.pack(zlib.crc32(body)) == data[-_CRC.size :]
