"""The demonstration log as bytes: what a record looks like.

Layout, little-endian: a header (magic, version, bins, px, profile, CRC-32), then records of one size, each with a
CRC-32 of its own. A record that is sealed but makes no sense is none.

The byte of flags and the number of the run were zero bits in the first logs, which read as run 0, not mirrored.
"""

import math
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from lira.fusion.learning.labels import is_rest
from lira.fusion.preprocess import from_uint8, to_uint8
from lira.hal.errors import StorageError
from lira.hal.messages import Action, FloatArray
from lira.hal.profile import MAX_BINS, MAX_IMAGE_PX, RobotProfile

MAGIC = b"LIRADEMO"
VERSION = 1
LIMIT = 1.01  # actions are in [-1, 1] and ranges in [0, 1], give or take the rounding of who divided

_HEADER = struct.Struct("<8sHHHH")  # magic, version, bins, px, bytes of the profile's name
_FIELDS = struct.Struct("<dqHHB32sdddd")  # stamp, observation, lap, run, flags, source, action, novice's action
_FLAGS_AT, _SOURCE_AT = 20, 21
_ACTIONS_AT = (53, 61, 69, 77)
_SOURCE_BYTES = 32
_STORED, _MIRRORED, _CORRECTION = 1, 2, 4
_FLAGS = _STORED | _MIRRORED | _CORRECTION
_MOST = 2**16 - 1  # laps and runs are not counted further
_CRC = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class Demonstration:
    """One label that was given, and whether the redundancy filter stored it.

    `source` is "human", an expert's name or "mean"; `novice` is a^N at that time; `scan` float32 [bins] and `image`
    float32 [px, px] are the features. `mirrored`: it was learned with left and right exchanged, too. `run` is which
    opening of the log it was given in, from 0; the log sets both.

    A *correction* is a copy of a label that says anew whether it is `stored`: labels are taken back by appending, so
    none is lost. `read_demonstrations` yields no corrections, but each label as the last of them has it; `undone` is
    what was stored and is not any more.
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
    correction: bool = False
    undone: bool = False

    @property
    def key(self) -> tuple[int, float, int, str]:
        """What tells it from every other label of a log: a run has one at most at a step."""
        return self.run, self.stamp_s, self.observation, self.source

    @property
    def idle(self) -> bool:
        """Whether the human had control and did nothing."""
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
        flags = _STORED * record.stored + _MIRRORED * record.mirrored + _CORRECTION * record.correction
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
        if not (name and bounded and finite and flags <= _FLAGS):
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
            correction=bool(flags & _CORRECTION),
        )

    def places(self, block: bytes) -> NDArray[np.intp]:
        """Return where in a block a record may begin: few places, so that few checksums are reckoned."""
        count = max(len(block) - self.record_bytes + 1, 0)
        data = np.frombuffer(block, np.uint8)
        likely = (data[_FLAGS_AT:][:count] <= _FLAGS) & (data[_SOURCE_AT:][:count] > ord(" "))
        for at in _ACTIONS_AT:  # the top byte of a number below 2
            likely &= data[at + 7 :][:count] & 0x7F <= 0x3F
        return np.flatnonzero(likely)


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
