"""The demonstration log as bytes: what a record looks like.

Layout, little-endian: a header (magic, version, features as JSON, profile, CRC-32), then records of one size, each with
a CRC-32 of its own: fields, then the arrays, scans as float32 before pictures of 8 bits. A record that is sealed but
makes no sense is none.

Version 1 had a scan and an image, and their two sizes in the header; its records are the same, so such a log is read,
and goes on as it is. The byte of flags and the number of the run were zero bits in the first logs, which read as run 0,
not mirrored.
"""

import math
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from lira.fusion.learning.labels import is_rest
from lira.fusion.preprocess import MODALITIES, Features, Shape, shapes_of
from lira.hal.config import MALFORMED
from lira.hal.errors import StorageError
from lira.hal.messages import Action, Driver
from lira.hal.profile import RobotProfile

MAGIC = b"LIRADEMO"
VERSION = 2
LIMIT = 1.01  # actions are in [-1, 1] and features in [0, 1], give or take the rounding of who divided

_BEGIN = struct.Struct("<8sH")  # magic, version
_SIZES = struct.Struct("<HH")  # bytes of the features' JSON, of the profile's name
_FIRST_SIZES = struct.Struct("<HHH")  # of version 1: bins, px, bytes of the profile's name
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

    `source` is the driver who gave it; `novice` is a^N at that time; `features` what was seen.
    `mirrored`: it was learned with left and right exchanged, too. `run` is which opening of the log it was given in,
    from 0; the log sets both.

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
    features: Features
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
        return self.source == Driver.HUMAN and is_rest(self.action)


@dataclass(frozen=True, slots=True)
class Format:
    """What a log holds, from its header: the features' names and shapes in the order in which they lie in a record."""

    features: tuple[tuple[str, Shape], ...]
    profile: str
    version: int = field(default=VERSION, compare=False)

    @classmethod
    def of(cls, profile: RobotProfile) -> Self:
        """Return the format of a robot's logs."""
        return cls.holding(shapes_of(profile), profile.name)

    @classmethod
    def holding(cls, shapes: Mapping[str, Shape], profile: str) -> Self:
        """Return the format of logs with these features. Raises `ValueError` for some that no robot of ours has."""
        if not shapes or not shapes.keys() <= MODALITIES.keys():
            raise ValueError(f"features {', '.join(shapes)}")
        for name, shape in shapes.items():
            MODALITIES[name].check(shape)
        wide_first = sorted(shapes.items(), key=lambda each: -_itemsize(each[0]))
        return cls(tuple(wide_first), profile)

    @property
    def record_bytes(self) -> int:
        """Size of every record."""
        return _CRC.size + _FIELDS.size + sum(_itemsize(name) * math.prod(shape) for name, shape in self.features)

    def header(self) -> bytes:
        """Return the file's first bytes."""
        name = self.profile.encode()
        begin = _BEGIN.pack(MAGIC, self.version)
        if self.version == 1:
            shapes = dict(self.features)
            return _sealed(begin + _FIRST_SIZES.pack(shapes["scan"][0], shapes["image"][0], len(name)) + name)
        features = msgspec.json.encode(dict(self.features))
        return _sealed(begin + _SIZES.pack(len(features), len(name)) + features + name)

    def words(self) -> str:
        """The robot and its features, for people."""
        sizes = ", ".join(f"{name} {'x'.join(map(str, shape))}" for name, shape in self.features)
        return f"'{self.profile}' ({sizes})"

    def encode(self, record: Demonstration) -> bytes:
        """Raises `ValueError` for what `decode` would not take: features of another size, actions out of range."""
        source = record.source.encode()
        shapes = {name: array.shape for name, array in record.features.items()}
        if shapes != dict(self.features) or len(source) > _SOURCE_BYTES:
            raise ValueError(
                f"a label of '{record.source}' with {record.features} does not fit a log of {self.words()}"
            )
        flags = _STORED * record.stored + _MIRRORED * record.mirrored + _CORRECTION * record.correction
        counts = min(record.lap, _MOST), min(record.run, _MOST)
        fields = (record.stamp_s, record.observation, *counts, flags, source, *record.action, *record.novice)
        kept = [
            MODALITIES[name].keep(record.features[name]).astype(_dtype(name)).tobytes() for name, _ in self.features
        ]
        data = _sealed(_FIELDS.pack(*fields) + b"".join(kept))
        if self.decode(data) is None:
            raise ValueError(f"a label of '{record.source}' with the actions {record.action} and {record.novice}")
        return data

    def decode(self, data: bytes) -> Demonstration | None:
        """None for bytes that are not a whole record, or a sealed one that makes no sense."""
        if len(data) != self.record_bytes or not _is_sealed(data):
            return None
        stamp_s, observation, lap, run, flags, source, *actions = _FIELDS.unpack_from(data)
        features = self._features(data)
        name = _text(source.rstrip(b"\0"))
        # A nan among others need not be the largest of them; in the sum it shows.
        finite = math.isfinite(stamp_s + sum(actions))
        if not (name and finite and max(map(abs, actions)) <= LIMIT and flags <= _FLAGS):
            return None
        if features is None:
            return None
        return Demonstration(
            stamp_s=stamp_s,
            observation=observation,
            lap=lap,
            source=name,
            action=(actions[0], actions[1]),
            novice=(actions[2], actions[3]),
            stored=bool(flags & _STORED),
            features=features,
            mirrored=bool(flags & _MIRRORED),
            run=run,
            correction=bool(flags & _CORRECTION),
        )

    def _features(self, data: bytes) -> Features | None:
        """What was seen, of a record's bytes; None if that cannot have been."""
        arrays, at = {}, _FIELDS.size
        for name, shape in self.features:
            kept = np.frombuffer(data, _dtype(name), math.prod(shape), at).reshape(shape).copy()  # learners may write
            arrays[name] = MODALITIES[name].restore(kept)
            at += kept.nbytes
            if not (np.abs(arrays[name]).max() <= LIMIT and math.isfinite(arrays[name].sum())):
                return None
        return Features(**arrays)

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
    start = file.read(_BEGIN.size)
    if len(start) < _BEGIN.size or not start.startswith(MAGIC):
        raise StorageError(f"{path} is no log of labels", "Give the path of a log of labels, or of its run's folder.")
    _, version = _BEGIN.unpack(start)
    if version not in (1, VERSION):
        raise StorageError(f"{path} is a log of version {version}", f"This program reads versions 1 to {VERSION}.")
    try:
        return _read_sizes(file, start, version)
    except (*MALFORMED, struct.error) as error:
        raise StorageError(
            f"the header of {path} is damaged", f"See what can be saved: lira labels check {path}"
        ) from (error)


def _read_sizes(file: BinaryIO, start: bytes, version: int) -> Format:
    """Read what follows the version. Raises `ValueError` and its like for what makes no sense."""
    sizes = _FIRST_SIZES if version == 1 else _SIZES
    start += file.read(sizes.size)
    *_, name_bytes = counts = sizes.unpack_from(start, _BEGIN.size)
    features_bytes = 0 if version == 1 else counts[0]
    text = file.read(features_bytes + name_bytes)
    name = _text(text[features_bytes:])
    if not (name and _is_sealed(start + text + file.read(_CRC.size))):
        raise ValueError("it is not sealed")
    if version == 1:
        shapes: dict[str, Shape] = {"scan": (counts[0],), "image": (counts[1], counts[1])}
    else:
        shapes = msgspec.json.decode(text[:features_bytes], type=dict[str, Shape])
    return replace(Format.holding(shapes, name), version=version)


def _dtype(name: str) -> str:
    return "<f4" if MODALITIES[name].dtype is np.float32 else "u1"


def _itemsize(name: str) -> int:
    return np.dtype(_dtype(name)).itemsize


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
