"""The streams of an RPLIDAR, as bytes: one function for each answer type. Pure."""

import math
import struct
from functools import reduce
from operator import xor

import numpy as np
from numpy.typing import NDArray

from lira.sim_backend.polyline import Floats

NOTHING_LOW, NOTHING_HIGH = -512, 511  # of ten bits: these differences say that nothing was measured
HIGHEST_MM = 28671
# Millimetres from these on are counted in steps of 2 ** level, and these counts say so.
SCALES = ((16384, 3328, 4), (4096, 1792, 3), (2048, 1280, 2), (512, 512, 1), (0, 0, 0))

# Scales of the ultra dense stream: from these millimetres on, in steps of so many, in so many bits.
COARSENING = ((0, 2, 10), (2046, 3, 11), (8187, 4, 12), (24567, 5, 13))


def encode_nodes(theta_rad: Floats, distance_m: Floats, starts: NDArray[np.bool_] | None = None) -> bytes:
    """Standard nodes [n]; `starts`: those that open a turn, of themselves the first after the unit's front."""
    if starts is None:
        starts = np.append(False, np.diff(theta_rad) < -math.pi)
    nodes = bytearray()
    for theta, distance, start in zip(theta_rad.tolist(), distance_m.tolist(), starts.tolist(), strict=True):
        angle = round(math.degrees(theta) * 64) % 23040
        quality = 15 if distance > 0 else 0
        nodes += struct.pack(
            "<BHH", quality << 2 | (1 if start else 2), angle << 1 | 1, round(distance * 4000) & 0xFFFF
        )
    return bytes(nodes)


def encode_express(
    start_rad: Floats, distance_m: Floats, first: bool = False, behind_rad: Floats | None = None
) -> bytes:
    """Express capsules from start angles [n], distances [n, 32], and how far behind the head each point lies."""
    behind_rad = np.zeros_like(distance_m) if behind_rad is None else behind_rad
    words = np.rint(distance_m * 1000).astype(np.int64) << 2
    eighths = np.clip(np.rint(np.degrees(behind_rad) * 8), 0, 63).astype(np.int64)
    words |= eighths >> 4
    low = eighths & 0x0F
    stream = b""
    for number, start in enumerate(start_rad.tolist()):
        cabins = b"".join(
            struct.pack("<HHB", words[number, i], words[number, i + 1], low[number, i] | low[number, i + 1] << 4)
            for i in range(0, 32, 2)
        )
        stream += seal(start, cabins, begins=first and number == 0)
    return stream


def encode_dense(start_rad: Floats, distance_m: Floats, first: bool = False) -> bytes:
    """Dense capsules from start angles [n] and distances [n, 40]."""
    bodies = np.rint(distance_m * 1000).astype("<u2")
    pairs = enumerate(zip(start_rad, bodies, strict=True))
    return b"".join(seal(float(start), body.tobytes(), begins=first and number == 0) for number, (start, body) in pairs)


def encode_ultra_dense(start_rad: Floats, distance_m: Floats, first: bool = False) -> bytes:
    """Ultra dense capsules from start angles [n] and distances [n, 64]."""
    stream = b""
    for number, (start, distances) in enumerate(zip(start_rad.tolist(), distance_m, strict=True)):
        one, two = (np.array([pack_twenty(round(each * 1000)) for each in distances[side::2]]) for side in (0, 1))
        cabins = np.stack([one, one >> 8, two, two >> 8, one >> 16 | (two >> 16) << 4], axis=-1) & 0xFF
        stream += seal(start, cabins.astype(np.uint8).tobytes(), begins=first and number == 0, before=bytes(6))
    return stream


def pack_twenty(mm: int) -> int:
    """Twenty bits for a distance: its scale, its count, and above them a quality."""
    scale = next(number for number in (3, 2, 1, 0) if mm >= COARSENING[number][0])
    base_mm, step_mm, width = COARSENING[scale]
    count = min(round((mm - base_mm) / step_mm), (1 << width) - 1)
    return (scale | count << 2 | 0xFF << 2 + width) & 0xFFFFF


def encode_ultra(start_rad: Floats, distance_m: Floats, first: bool = False) -> bytes:
    """Ultra capsules from start angles [n] and distances [n, 97]: the last of each is the next one's first.

    Of three points one is given, the others by how they differ from it and from the one after them.
    """
    stream = b""
    for number, (start, distances) in enumerate(zip(start_rad.tolist(), distance_m, strict=True)):
        mm = [min(round(each * 1000), HIGHEST_MM) for each in distances.tolist()]
        scaled = [scale(mm[i]) for i in range(0, 97, 3)]
        cabins = b""
        for at in range(32):
            (count, base, level), (_, base2, level2) = scaled[at], scaled[at + 1]
            one = differ(mm[3 * at + 1], base or base2, level if base else level2)
            two = differ(mm[3 * at + 2], base2, level2)
            cabins += struct.pack("<I", count | (one & 0x3FF) << 12 | (two & 0x3FF) << 22)
        stream += seal(start, cabins, begins=first and number == 0)
    return stream


def scale(mm: int) -> tuple[int, int, int]:
    """Count of twelve bits for a distance; the distance that it stands for, and its level."""
    base, count, level = next(row for row in SCALES if mm >= row[0])
    steps = (mm - base) >> level
    return count + steps, base + (steps << level), level


def differ(mm: int, base_mm: int, level: int) -> int:
    """Ten bits for how a distance differs from its base; for one that cannot be said, or is none, that."""
    steps = round((mm - base_mm) / 2**level)
    return steps if mm > 0 and NOTHING_LOW < steps < NOTHING_HIGH else NOTHING_LOW


def seal(start_rad: float, body: bytes, *, begins: bool = False, before: bytes = b"") -> bytes:
    """Put the head on a capsule: check nibbles with the sum, what comes `before` the start angle, that angle, S."""
    angle = round(math.degrees(start_rad) * 64) % 23040 | (0x8000 if begins else 0)
    checked = before + struct.pack("<H", angle) + body
    total = reduce(xor, checked)
    return bytes([0xA0 | total & 0x0F, 0x50 | total >> 4]) + checked


ENCODERS = {0x84: encode_ultra, 0x85: encode_dense, 0x86: encode_ultra_dense}
"""By answer type, those that need no more than start angles and distances."""
