"""What two robots see from the same place: scans and pictures against each other. Pure."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lira.fusion.modalities.image import gray_image
from lira.hal.messages import FloatArray, LaserScan
from lira.hal.messages.ranges import read_ranges
from lira.tools.parity.record import Recording

Floats = NDArray[np.float64]

GRID_RAD = math.radians(1.0)
APART_M, APART_SHARE = 0.10, 0.05  # beams that differ by more than both together are apart
BETTER = 0.5  # a scan fits better in another way if that halves the difference
LEAST_M = 0.02


@dataclass(frozen=True, slots=True)
class ScanMatch:
    """Two scans of one place. `fit` says how the second lies best on the first: "as it is", "mirrored", ..."""

    median_m: float
    apart: float  # share of the beams
    fit: str


def stood(recording: Recording, name: str) -> list[float]:
    """Return the capture times of a sensor's messages while the robot stood at the beginning."""
    span = recording.span("stand")
    return [
        heard.message.stamp_s
        for heard in getattr(recording, name)
        if span.began_s <= heard.message.stamp_s <= span.ended_s
    ]


def still_scan(recording: Recording) -> tuple[Floats, Floats] | None:
    """Bearings [n] and median ranges [n] while it stood; no return is the longest range, nan says nothing."""
    times_s = set(stood(recording, "scan"))
    scans = [heard.message for heard in recording.scan if heard.message.stamp_s in times_s]
    scans = [scan for scan in scans if len(scan.ranges) == len(scans[-1].ranges)]
    if not scans:
        return None
    stack = np.sort(np.stack([_finite(scan) for scan in scans]), axis=0)  # nan last
    count = np.count_nonzero(~np.isnan(stack), axis=0)
    middle = np.take_along_axis(stack, np.maximum(count - 1, 0)[None] // 2, axis=0)[0]
    scan = scans[-1]
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    return np.remainder(angles + math.pi, math.tau) - math.pi, middle


def spoken(recording: Recording) -> float | None:
    """Share of the beams that say something while the robot stands."""
    scan = still_scan(recording)
    return None if scan is None else float(np.mean(~np.isnan(scan[1])))


def match_scans(first: Recording, second: Recording) -> ScanMatch | None:
    """Lay the scans of both on each other; None if either has none, or nothing in common."""
    one, other = still_scan(first), still_scan(second)
    if one is None or other is None:
        return None
    whole = all(_is_whole(bearings) for bearings, _ in (one, other))
    reach_rad = math.pi if whole else min(float(np.abs(bearings).max()) for bearings, _ in (one, other))
    grid = np.arange(-reach_rad, reach_rad - GRID_RAD / 2, GRID_RAD) + GRID_RAD / 2
    a, b = _on_grid(*one, grid), _on_grid(*other, grid)
    both = ~np.isnan(a) & ~np.isnan(b)
    if not both.any():
        return None
    off_m = np.abs(a - b)[both]
    apart = off_m > APART_M + APART_SHARE * a[both]
    return ScanMatch(float(np.median(off_m)), float(apart.mean()), _fit(a, b, whole))


def still_image(recording: Recording) -> FloatArray | None:
    """Median picture while it stood, as the networks see it: [px, px] in [0, 1]."""
    times_s = set(stood(recording, "image"))
    px = recording.profile.features.image_px
    pictures = [gray_image(heard.message, px) for heard in recording.image if heard.message.stamp_s in times_s]
    if not pictures:
        return None
    median: FloatArray = np.median(np.stack(pictures), axis=0).astype(np.float32)
    return median


def match_images(first: Recording, second: Recording) -> float | None:
    """Mean difference in gray levels of 255; None if either has no picture, or they differ in size."""
    one, other = still_image(first), still_image(second)
    if one is None or other is None or one.shape != other.shape:
        return None
    return float(np.abs(one - other).mean() * 255)


def brightness(recording: Recording) -> float | None:
    """Mean gray level of 255."""
    picture = still_image(recording)
    return None if picture is None else float(picture.mean() * 255)


def _finite(scan: LaserScan) -> Floats:
    ranges: Floats = read_ranges(scan).astype(np.float64)
    ranges[np.isposinf(ranges)] = scan.range_max
    ranges[np.isneginf(ranges)] = scan.range_min
    return ranges


def _is_whole(bearings: Floats) -> bool:
    return bool(np.diff(np.sort(bearings)).max() < math.radians(10.0) and np.abs(bearings).max() > math.radians(175.0))


def _on_grid(bearings: Floats, ranges: Floats, grid: Floats) -> Floats:
    """Take the nearest beam for each bearing of the grid."""
    off = np.abs(np.remainder(grid[:, None] - bearings[None, :] + math.pi, math.tau) - math.pi)
    nearest: Floats = ranges[off.argmin(axis=1)]
    return nearest


def _fit(a: Floats, b: Floats, whole: bool) -> str:
    """Try the second scan mirrored, and over a whole turn also turned."""
    tried = []
    for mirrored in (False, True):
        flipped = b[::-1] if mirrored else b
        for turn in range(len(b) if whole else 1):
            turned = np.roll(flipped, turn)
            both = ~np.isnan(a) & ~np.isnan(turned)
            if np.count_nonzero(both) >= len(a) / 4:
                tried.append((float(np.abs(a - turned)[both].mean()), mirrored, turn))
    if not tried:
        return "in no way"
    as_it_is = next((cost for cost, mirrored, turn in tried if not mirrored and turn == 0), math.inf)
    best_m, mirrored, turn = min(tried)
    if as_it_is <= LEAST_M or best_m > BETTER * as_it_is:
        return "as it is"
    degrees = math.remainder(turn * 360.0 / len(b), 360.0)
    words = ["mirrored"] if mirrored else []
    words += [f"turned by {degrees:+.0f} deg"] if turn else []
    return " and ".join(words)
