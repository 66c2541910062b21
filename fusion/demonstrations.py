"""The demonstration log: every label with what was seen, in one append-only file.

A stored label survives `kill -9`: each record is one write to the kernel. The file is synced to the disk when it is
closed, not at every label, which could stall the control loop: a power cut can cost what the kernel still holds.

Layout, little-endian: a header (magic, version, bins, px, profile, CRC-32), then records of one size, each with a
CRC-32 of its own. One size keeps a damaged record from hiding the ones behind it.

The byte of flags and the number of the run were zero bits in the first logs, which read as run 0, not mirrored.
"""

import fcntl
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from fusion.labels import is_rest
from fusion.preprocess import from_uint8, to_uint8
from hal.errors import StorageError
from hal.messages import Action, FloatArray
from hal.profile import RobotProfile

MAGIC = b"LIRADEMO"
VERSION = 1
# Told to the user while there is still room for this many labels, so that none is lost before the disk is full.
RESERVE = 256

_HEADER = struct.Struct("<8sHHHH")  # magic, version, bins, px, bytes of the profile's name
_FIELDS = struct.Struct("<dqHHB32sdddd")  # stamp, observation, lap, run, flags, source, action, novice's action
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
class _Format:
    """What a log holds, from its header."""

    bins: int
    px: int
    profile: str

    @property
    def record_bytes(self) -> int:
        return _CRC.size + _FIELDS.size + 4 * self.bins + self.px**2

    def header(self) -> bytes:
        name = self.profile.encode()
        return _sealed(_HEADER.pack(MAGIC, VERSION, self.bins, self.px, len(name)) + name)

    def encode(self, record: Demonstration) -> bytes:
        """Raises `ValueError` for features of another size or a source whose name is too long."""
        source = record.source.encode()
        if record.scan.shape != (self.bins,) or record.image.shape != (self.px, self.px) or len(source) > 32:
            raise ValueError(
                f"a label of '{record.source}' with a scan {record.scan.shape} and an image {record.image.shape} "
                f"does not fit a log of {self.bins} bins and {self.px} px"
            )
        flags = _STORED * record.stored + _MIRRORED * record.mirrored
        counts = min(record.lap, _MOST), min(record.run, _MOST)
        fields = (record.stamp_s, record.observation, *counts, flags, source, *record.action, *record.novice)
        scan = np.ascontiguousarray(record.scan, dtype="<f4").tobytes()
        return _sealed(_FIELDS.pack(*fields) + scan + to_uint8(record.image).tobytes())

    def decode(self, data: bytes) -> Demonstration | None:
        """None for bytes that are not a whole record."""
        if not self.is_whole(data):
            return None
        stamp_s, observation, lap, run, flags, source, *actions = _FIELDS.unpack_from(data)
        scan = np.frombuffer(data, "<f4", self.bins, _FIELDS.size).astype(np.float32)
        gray = np.frombuffer(data, np.uint8, self.px**2, _FIELDS.size + 4 * self.bins).reshape(self.px, self.px)
        return Demonstration(
            stamp_s=stamp_s,
            observation=observation,
            lap=lap,
            source=source.rstrip(b"\0").decode(),
            action=(actions[0], actions[1]),
            novice=(actions[2], actions[3]),
            stored=bool(flags & _STORED),
            scan=scan,
            image=from_uint8(gray),
            mirrored=bool(flags & _MIRRORED),
            run=run,
        )

    def is_whole(self, data: bytes) -> bool:
        """Whether these bytes are one record."""
        return len(data) == self.record_bytes and _is_sealed(data)


class DemonstrationLog:
    """The writing end. `count` records were good when it was opened, `repaired_bytes` of a torn tail were cut off.

    `run` is the number of this opening; `mirrored` says how the stored labels are learned. Nothing is kept in memory.
    Raises `StorageError` when the file is another robot's, corrupt, in use by another process, or cannot be written.
    """

    def __init__(self, path: Path, profile: RobotProfile, *, mirrored: bool = False) -> None:
        self._path = path
        self._mirrored = mirrored
        self._format = _Format(profile.features.bins, profile.features.image_px, profile.name)
        self._unwritten: list[bytes] = []
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
        except OSError as error:
            raise StorageError(f"cannot open {path}: {error.strerror}", "Choose another folder.") from error
        try:
            self._lock()
            self.count, self._end, self.run = self._recover()
            self.repaired_bytes = os.fstat(self._file).st_size - self._end
            os.ftruncate(self._file, self._end)
            if self._end == 0:
                self._write(self._format.header())
            self._check_space()
        except BaseException:
            os.close(self._file)
            raise

    def append(self, record: Demonstration) -> None:
        """Store a label.

        Raises `StorageError` when the disk is nearly full, though this label is stored, and when it is full or fails:
        then the label is kept in memory and written before the next one.
        """
        record = replace(record, run=self.run, mirrored=self._mirrored and record.stored)
        self._unwritten.append(self._format.encode(record))
        self._drain()
        self._check_space()

    def sync(self) -> None:
        """Wait until every label is on the disk itself. May be called from any thread. Raises `StorageError`."""
        try:
            os.fsync(self._file)
        except OSError as error:
            raise self._failed(error) from error

    def close(self) -> None:
        """Write what is left, sync and unlock. Raises `StorageError` if labels could not be written."""
        if self._file < 0:
            return
        try:
            self._drain()
            os.fsync(self._file)
        except OSError as error:
            raise self._failed(error) from error
        finally:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> "DemonstrationLog":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _drain(self) -> None:
        while self._unwritten:
            self._write(self._unwritten[0])
            del self._unwritten[0]

    def _write(self, data: bytes) -> None:
        """Write all of it or nothing."""
        written = 0
        try:
            while written < len(data):  # after a short write the next one says why
                written += os.write(self._file, data[written:])
        except OSError as error:
            os.ftruncate(self._file, self._end)
            raise self._failed(error) from error
        self._end += written

    def _failed(self, error: OSError) -> StorageError:
        what = f"cannot write to {self._path}: {error.strerror}"
        return StorageError(f"{what}; {len(self._unwritten)} labels wait in memory", "Free some space on that disk.")

    def _check_space(self) -> None:
        disk = os.fstatvfs(self._file)
        free = disk.f_bavail * disk.f_frsize
        if free < RESERVE * self._format.record_bytes:
            raise StorageError(f"the disk of {self._path} is nearly full: {free // 1024} kB", "Free some space on it.")

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            remedy = "Stop the other one, or give this one another file."
            raise StorageError(f"{self._path} is in use by another process", remedy) from error

    def _recover(self) -> tuple[int, int, int]:
        """Return the number of good records, where they end, and which run begins.

        Raises `StorageError` for a file to keep off.
        """
        header = self._format.header()
        with self._path.open("rb") as file:
            if header.startswith(file.read(len(header) + 1)):  # new, or torn in its very first write
                file.seek(0, os.SEEK_END)
                if file.tell() < len(header):
                    return 0, 0, 0
            file.seek(0)
            found = _read_format(file, self._path)
            if found != self._format:
                raise StorageError(
                    f"{self._path} holds demonstrations for '{found.profile}' ({found.bins} bins, {found.px} px), "
                    f"not for '{self._format.profile}' ({self._format.bins} bins, {self._format.px} px)",
                    "Give a new file for this robot.",
                )
            count, last = 0, b""
            for data in _records(file, found, self._path):
                count, last = count + 1, data
        newest = found.decode(last)
        return count, len(header) + count * found.record_bytes, 0 if newest is None else newest.run + 1


def read_demonstrations(path: Path) -> Iterator[Demonstration]:
    """Stream the labels of a log, one at a time, without its torn tail, if any; the log may be in use.

    Raises `StorageError` for a file that is missing, no log, or damaged before its end.
    """
    try:
        with path.open("rb") as file:
            form = _read_format(file, path)
            for data in _records(file, form, path):
                record = form.decode(data)
                if record is not None:
                    yield record
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}", "Check the path.") from error


def _read_format(file: BinaryIO, path: Path) -> _Format:
    start = file.read(_HEADER.size)
    if len(start) < _HEADER.size or not start.startswith(MAGIC):
        raise StorageError(f"{path} is no demonstration log", "Give the path of a log, or of a new file.")
    _, version, bins, px, name_bytes = _HEADER.unpack(start)
    if version != VERSION:
        raise StorageError(f"{path} is a log of version {version}", f"This program reads version {VERSION}.")
    rest = file.read(name_bytes + _CRC.size)
    if not _is_sealed(start + rest):
        raise StorageError(f"the header of {path} is corrupt", "Restore the file from a copy.")
    return _Format(bins, px, rest[:name_bytes].decode())


def _records(file: BinaryIO, form: _Format, path: Path) -> Iterator[bytes]:
    """Whole records up to the torn tail. A bad one with a good one behind it is damage, not a torn tail."""
    count = 0
    while data := file.read(form.record_bytes):
        if not form.is_whole(data):
            offset = file.tell() - len(data)
            if any(form.is_whole(later) for later in iter(lambda: file.read(form.record_bytes), b"")):
                raise StorageError(
                    f"{path} is corrupt at byte {offset}; the {count} records before it are good",
                    "Restore the file from a copy, or move it away and start a new one.",
                )
            return
        count += 1
        yield data


def _sealed(data: bytes) -> bytes:
    return data + _CRC.pack(zlib.crc32(data))


def _is_sealed(data: bytes) -> bool:
    body = data[: -_CRC.size]
    return len(data) > _CRC.size and _CRC.pack(zlib.crc32(body)) == data[-_CRC.size :]
