"""Scans as the networks see them: the nearest return in each of `bins` directions ahead, in [0, 1]."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lira.fusion.modalities.reading import ReadingError
from lira.hal.messages import FloatArray, LaserScan
from lira.hal.messages.ranges import read_ranges
from lira.hal.profile import Features as FeatureShape

# Beam angles arrive as float32, so a beam that lies on the edge between two bins is off by less than this.
EDGE_BINS = 1e-3


def bin_scan(scan: LaserScan, shape: FeatureShape) -> tuple[FloatArray, int]:
    """Crop a scan to the field of view ahead, bin it and normalise it.

    Returns float32 [bins] (counter-clockwise, the nearest return of each bin over `max_range_m`; 1.0: no return,
    0.0: too close) and the number of invalid beams. A bin without a valid beam takes its nearest neighbour's value.
    Which beams are valid, too close or without a return is as `hal.ranges` has it.
    Raises `SensorError` for a scan that does not cover the field of view or that is invalid in most of it.
    """
    if np.ndim(scan.ranges) != 1:
        raise ReadingError(
            "scan shape", f"the scan has {np.ndim(scan.ranges)} dimensions instead of 1", "Check the lidar driver."
        )
    layout = _layout(len(scan.ranges), scan.angle_min, scan.angle_increment, shape.fov_rad, shape.bins)
    beams = read_ranges(scan, layout.beams)
    invalid = int(np.count_nonzero(np.isnan(beams)))
    nearest = np.full(shape.bins, np.nan, dtype=np.float32)
    nearest[layout.bins] = np.fmin.reduceat(beams, layout.starts)
    if invalid or layout.bins.size < shape.bins:
        nearest = _fill(nearest)
    return np.clip(nearest / np.float32(shape.max_range_m), 0.0, 1.0), invalid


@dataclass(frozen=True, slots=True)
class _Layout:
    """Which beams fall into which bins: `beams` sorted by bin, `starts` of each group in it, `bins` of the groups."""

    beams: NDArray[np.intp]
    starts: NDArray[np.intp]
    bins: NDArray[np.intp]


@lru_cache(maxsize=16)
def _layout(count: int, angle_min: float, increment: float, fov_rad: float, bins: int) -> _Layout:
    """Sort the beams of a scan into bins. Raises `SensorError` where they do not cover the field of view."""
    remedy = "Compare the lidar's settings with the [lidar] and [features] tables of the robot's profile."
    turn = 2 * math.pi
    if not (abs(angle_min) <= 2 * turn and 0.0 < abs(increment) <= turn):  # nan is neither
        what = f"the scan's angles make no sense: angle_min {angle_min}, angle_increment {increment}"
        raise ReadingError("scan angles", what, remedy)
    step = abs(increment)
    if count < 2 or count * step > turn + 1.5 * step:
        what = f"a scan of {count} beams every {math.degrees(step):.3g} deg has the wrong length"
        raise ReadingError("scan length", what, remedy)
    width = fov_rad / bins
    if not _covers(count, angle_min, increment, fov_rad, max(width, step) / 2):
        what = (
            f"the scan has the wrong length: {count} beams from {math.degrees(angle_min):.1f} deg every "
            f"{math.degrees(increment):.3g} deg do not cover the {math.degrees(fov_rad):.0f} deg ahead"
        )
        raise ReadingError("scan length", what, remedy)
    angles = np.remainder(angle_min + increment * np.arange(count) + math.pi, turn) - math.pi
    position = (angles + fov_rad / 2) / width
    inside = np.flatnonzero((position >= -EDGE_BINS) & (position <= bins + EDGE_BINS))
    index = np.clip(np.floor(position[inside] + EDGE_BINS), 0, bins - 1).astype(np.intp)
    order = np.argsort(index, kind="stable")
    groups, starts = np.unique(index[order], return_index=True)
    return _Layout(inside[order], starts, groups)


def _covers(count: int, angle_min: float, increment: float, fov_rad: float, slack_rad: float) -> bool:
    """Whether beams reach both ends of the field of view ahead, whatever turn their angles are counted in."""
    if (count + 0.5) * abs(increment) >= 2 * math.pi:
        return True
    low, high = sorted((angle_min, angle_min + increment * (count - 1)))
    middle = (low + high) / 2
    turn = 2 * math.pi * round(middle / (2 * math.pi))
    return low - turn <= -fov_rad / 2 + slack_rad + 1e-4 and high - turn >= fov_rad / 2 - slack_rad - 1e-4


def _fill(values: FloatArray) -> FloatArray:
    """Give every nan the value of the nearest bin that has one; of two equally near, the smaller range."""
    known = np.flatnonzero(~np.isnan(values))
    if 2 * known.size < values.size:
        what = f"{values.size - known.size} of {values.size} bins of the scan have no valid beam"
        raise ReadingError("scan invalid", what, "Clean the lidar, and check that it turns and what is in its way.")
    if known.size == values.size:
        return values
    bins = np.arange(values.size)
    after = np.searchsorted(known, bins).clip(max=known.size - 1)
    before = (np.searchsorted(known, bins, side="right") - 1).clip(min=0)
    to_left, to_right = np.abs(bins - known[before]), np.abs(known[after] - bins)
    left, right = values[known[before]], values[known[after]]
    filled: FloatArray = np.where(to_left < to_right, left, right)
    return np.where(to_left == to_right, np.minimum(left, right), filled)
