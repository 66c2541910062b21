"""The express, ultra and both dense streams: capsules with a checksum and one angle for many points. Vectorised.

A capsule says where its first point is. How far it spans is taken from the way to it from the one before, for the head
turns evenly, so that no point has to wait for the capsule after it. One that does not follow from the one before gives
no points: a capsule is missing there, the unit counts its angle anew, or it is the first.
"""

import statistics
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lira.robot.rplidar.points import CORRECTION_RAD, FASTEST_HZ, NOTHING, Bytes, Floats, Points

CHECK_SIZE, ANGLE_SIZE = 2, 2
SPANS = 15  # so many capsules tell how far one spans
# A capsule so many times as far from the one before as they are of late, and a bit, does not follow it.
STRETCH, SLACK_DEG = 1.5, 0.5
# The ultra stream counts millimetres in steps: from these counts on, as of these distances, in steps of 2 ** level.
SCALES = np.array([(0, 0, 0), (512, 512, 1), (1280, 2048, 2), (1792, 4096, 3), (3328, 16384, 4)])
# The ultra dense stream, by its two lowest bits: from how many millimetres on, in steps of how many, in how many bits.
STEPS = np.array([(0, 2, 10), (2046, 3, 11), (8187, 4, 12), (24567, 5, 13)])
NO_RETURN = (-512, 511)  # of ten bits
# How far behind the head's direction a point at a distance lies, which the ultra stream leaves to us: so far without a
# distance; else so far at infinity, less so much over the distance.
BLANK_DEG, FAR_DEG, NEAR_M_DEG = 7.5, 8.0, float(np.degrees(98361 / 4000 * 64 / 65536))
NEAREST_M = 0.05


@dataclass(frozen=True, slots=True)
class Layout:
    """One answer type. `read`: bodies [n, m] become metres and degrees behind the head [n, points].

    `angle_at`: byte of the start angle, before the body. `ahead`: so many points at the end of a body are only known
    with the next one; in the last row they are nan.
    """

    size: int
    points: int
    read: Callable[[Bytes], tuple[Floats, Floats]]
    back_rad: float
    ahead: int = 0
    angle_at: int = CHECK_SIZE

    def starts(self, capsules: Bytes) -> tuple[Floats, NDArray[np.bool_]]:
        """Start angles of capsules [n] in degrees, and which of them begin a stream."""
        words = capsules[:, self.angle_at].astype(np.uint16) | capsules[:, self.angle_at + 1].astype(np.uint16) << 8
        return (words & 0x7FFF) / 64.0, words >> 15 == 1


class CapsuleDecoder:
    """Reads capsules of one layout, of a unit that takes `sample_s` for a sample."""

    def __init__(self, layout: Layout, sample_s: float) -> None:
        self.size = layout.size
        self.back_rad = layout.back_rad
        self._layout = layout
        self._widest_deg = 360.0 * FASTEST_HZ * sample_s * layout.points
        self._spans_deg: deque[float] = deque(maxlen=SPANS)
        self._buffer = b""
        self._start_deg = np.nan  # of the newest capsule
        self._newest: tuple[Bytes, float] | None = None  # its bytes and span, if its last points are still to come

    @property
    def left(self) -> int:
        """Bytes that wait for more."""
        return len(self._buffer)

    def feed(self, data: bytes) -> Points:
        """Take what came, and return the points that it completes."""
        self._buffer += data
        if len(self._buffer) < self.size:
            return Points(NOTHING, NOTHING, waiting=self._waiting)
        stream = np.frombuffer(self._buffer, np.uint8)
        pieces: list[tuple[Floats, Floats]] = [(NOTHING, NOTHING)]
        at = lost = 0
        while len(stream) - at >= self.size:
            capsules = stream[at : at + (len(stream) - at) // self.size * self.size].reshape(-1, self.size)
            bad = np.flatnonzero(~_checks(capsules))
            count = int(bad[0]) if len(bad) else len(capsules)
            if count:
                theta_rad, distance_m, missing = self._take(capsules[:count])
                pieces.append((theta_rad, distance_m))
                lost += missing * self.size
                at += count * self.size
            if len(bad):
                skip = self._find(stream[at:])
                lost += skip
                at += skip
        self._buffer = self._buffer[at:]
        theta_rad, distance_m = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return Points(theta_rad, distance_m, lost, self._waiting)

    @property
    def _waiting(self) -> int:
        return 0 if self._newest is None else self._layout.ahead

    def _find(self, data: Bytes) -> int:
        """Count the bytes, at least one, before the first place where a capsule may begin, complete or not."""
        nibbles = (data[1:-1] >> 4 == 0xA) & (data[2:] >> 4 == 0x5)
        for at in np.flatnonzero(nibbles) + 1:
            capsule = data[at : at + self.size]
            if len(capsule) < self.size or _checks(capsule[None])[0]:
                return int(at)
        # The last byte may be the first of a capsule.
        return max(len(data) - 1, 1)

    def _take(self, run: Bytes) -> tuple[Floats, Floats, int]:
        """Points of good capsules [n] in a row, and how many capsules are missing between them."""
        start_deg, begins = self._layout.starts(run)
        gap_deg = np.diff(start_deg, prepend=self._start_deg) % 360.0
        self._start_deg = float(start_deg[-1])
        told = ~begins & np.isfinite(gap_deg)
        self._spans_deg.extend(gap_deg[told].tolist())
        usual_deg = statistics.median(self._spans_deg) if len(self._spans_deg) > SPANS // 3 else np.inf
        follows = told & (gap_deg <= min(self._widest_deg, STRETCH * usual_deg) + SLACK_DEG)
        theta_rad, distance_m = self._points(run, start_deg, gap_deg, follows)
        return theta_rad, distance_m, int(np.count_nonzero(told & ~follows))

    def _points(
        self, run: Bytes, start_deg: Floats, span_deg: Floats, follows: NDArray[np.bool_]
    ) -> tuple[Floats, Floats]:
        """Points of those capsules [n] that follow."""
        count, ahead = self._layout.points, self._layout.ahead
        wanted = np.repeat(follows[:, None], count, axis=1)
        if ahead:
            # The newest capsule's last points come with the next one, if that follows it.
            wanted[:-1, -ahead:] &= follows[1:, None]
            wanted[-1, -ahead:] = False
            if self._newest is not None:
                before, before_deg = self._newest
                run = np.concatenate([before[None], run])
                first_deg, _ = self._layout.starts(before[None])
                start_deg, span_deg = np.append(first_deg, start_deg), np.append(before_deg, span_deg)
                wanted = np.concatenate([[[*[False] * (count - ahead), *[follows[0]] * ahead]], wanted])
            self._newest = (run[-1].copy(), float(span_deg[-1])) if follows[-1] else None
        distance_m, behind_deg = self._layout.read(run[:, self._layout.angle_at + ANGLE_SIZE :])
        theta_deg = start_deg[:, None] + np.nan_to_num(span_deg)[:, None] * (np.arange(count) / count) - behind_deg
        return np.radians(theta_deg[wanted] % 360.0), distance_m[wanted]


def _checks(capsules: Bytes) -> NDArray[np.bool_]:
    """Which capsules [n, size] have their check nibbles and their sum right."""
    nibbles = ((capsules[:, 0] >> 4) == 0xA) & ((capsules[:, 1] >> 4) == 0x5)
    given = (capsules[:, 0] & 0x0F) | capsules[:, 1] << 4
    ok: NDArray[np.bool_] = nibbles & (given == np.bitwise_xor.reduce(capsules[:, CHECK_SIZE:], axis=1))
    return ok


def read_express(bodies: Bytes) -> tuple[Floats, Floats]:
    """16 cabins: two distances / 4 mm, each with 2 bits of how far it is behind / 8 deg, and the rest of both."""
    cabins = bodies.reshape(len(bodies), 16, 5).astype(np.uint16)
    words = np.stack([cabins[..., 0] | cabins[..., 1] << 8, cabins[..., 2] | cabins[..., 3] << 8], axis=-1)
    low = np.stack([cabins[..., 4] & 0x0F, cabins[..., 4] >> 4], axis=-1)
    behind_deg = (low | (words & 0x03) << 4) / 8.0
    shape = len(bodies), EXPRESS.points
    return (words & 0xFFFC).reshape(shape) / 4000.0, behind_deg.reshape(shape)


def read_dense(bodies: Bytes) -> tuple[Floats, Floats]:
    """40 distances in mm, where the head looks."""
    words = np.ascontiguousarray(bodies).view("<u2")
    return words / 1000.0, np.zeros((1, 1))


def read_ultra_dense(bodies: Bytes) -> tuple[Floats, Floats]:
    """32 cabins of two points, 20 bits each: quality, a distance, and the steps that it is counted in."""
    cabins = bodies.reshape(len(bodies), 32, 5).astype(np.int64)
    low = np.stack([cabins[..., 0] | cabins[..., 1] << 8, cabins[..., 2] | cabins[..., 3] << 8], axis=-1)
    high = np.stack([cabins[..., 4] & 0x0F, cabins[..., 4] >> 4], axis=-1)
    bits = (low | high << 16).reshape(len(bodies), ULTRA_DENSE.points)
    from_mm, step_mm, width = np.moveaxis(STEPS[bits & 0x3], -1, 0)
    return (from_mm + (bits >> 2 & (1 << width) - 1) * step_mm) / 1000.0, np.zeros((1, 1))


def read_ultra(bodies: Bytes) -> tuple[Floats, Floats]:
    """32 cabins of three points: a scaled distance of 12 bits, and how the second and the third differ, 10 bits each.

    The second differs from the first, or from the one after it if the first is none, the third from the one after it.
    """
    words = np.ascontiguousarray(bodies).view("<u4").astype(np.int64)
    majors = np.append((words & 0xFFF).reshape(-1), 0)
    row = np.searchsorted(SCALES[:, 0], majors, side="right") - 1
    level = SCALES[row, 2]
    base_mm = SCALES[row, 1] + ((majors - SCALES[row, 0]) << level)
    here, here_level, after, after_level = base_mm[:-1], level[:-1], base_mm[1:], level[1:]
    blank = here == 0
    one = _differ(words >> 12, np.where(blank, after, here), np.where(blank, after_level, here_level))
    two = _differ(words >> 22, after, after_level)
    distance_m = np.stack([here.astype(np.float64), one, two], axis=-1).reshape(len(bodies), ULTRA.points) / 1000.0
    distance_m[-1, -ULTRA.ahead :] = np.nan
    far_deg = FAR_DEG - NEAR_M_DEG / np.maximum(distance_m, NEAREST_M)
    return distance_m, np.where(distance_m >= NEAREST_M, far_deg, BLANK_DEG)


def _differ(bits: NDArray[np.int64], base_mm: NDArray[np.int64], level: NDArray[np.int64]) -> Floats:
    """Distances in mm [n] that differ from a base by ten bits with a sign; 0 where they say that there is none."""
    steps = (bits.reshape(-1) + 512 & 0x3FF) - 512
    mm = base_mm + (steps << level)
    return np.where((steps == NO_RETURN[0]) | (steps == NO_RETURN[1]), 0, np.maximum(mm, 0)).astype(np.float64)


EXPRESS = Layout(84, 32, read_express, CORRECTION_RAD)
ULTRA = Layout(132, 96, read_ultra, CORRECTION_RAD, ahead=2)
DENSE = Layout(84, 40, read_dense, 0.0)
# After the check a time and a state of the unit, which nothing here needs.
ULTRA_DENSE = Layout(170, 64, read_ultra_dense, 0.0, angle_at=8)
