"""How far and how much the robot really went, from what its lidar saw before and after. Pure."""

import math

import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import LaserScan
from lira.hal.messages.ranges import read_ranges
from lira.hal.profile import Base

CONE_RAD = math.radians(10.0)  # to each side of straight ahead: what fills it has to be one wall
SEEN = 0.8  # share of the beams in the cone that must say something
FLAT_M = 0.02  # standard deviation of a wall from a straight line
STEEPEST = math.tan(math.radians(20.0))
BINS = 720
OUTLIER_M = 0.3  # what differs by more is something else, or has moved
ALIKE = 2.0  # the second best turn has to fit this many times worse
APART_RAD = math.radians(8.0)

Floats = NDArray[np.float64]


def wall_ahead_m(scan: LaserScan) -> float | None:
    """Distance from the lidar to the wall straight ahead; None if what is there is not one flat wall."""
    angles, ranges = _beams(scan)
    cone = np.abs(angles) <= CONE_RAD
    seen = cone & np.isfinite(ranges)
    if not np.any(cone) or np.count_nonzero(seen) < max(SEEN * np.count_nonzero(cone), 3):
        return None
    x_m, y_m = ranges[seen] * np.cos(angles[seen]), ranges[seen] * np.sin(angles[seen])
    slope, ahead_m = np.polyfit(y_m, x_m, 1)
    flat = float(np.std(x_m - ahead_m - slope * y_m)) <= FLAT_M
    return float(ahead_m) if flat and abs(slope) <= STEEPEST else None


def free_ahead_m(scan: LaserScan, base: Base, margin_m: float) -> float:
    """Distance from the lidar to the nearest thing on the way ahead, as wide as the body and a margin; inf if none."""
    angles, ranges = _beams(scan)
    x_m, y_m = ranges * np.cos(angles), ranges * np.sin(angles)
    in_the_way = np.isfinite(ranges) & (x_m > 0.0) & (np.abs(y_m) <= base.width_m / 2 + margin_m)
    return float(np.min(x_m, initial=math.inf, where=in_the_way))


def free_around_m(scan: LaserScan) -> float:
    """Distance from the lidar to the nearest thing in any direction; inf if there is none."""
    _, ranges = _beams(scan)
    return float(np.min(ranges, initial=math.inf, where=np.isfinite(ranges)))


def turn_between(before: LaserScan, after: LaserScan, expected_rad: float, window_rad: float) -> float | None:
    """Turn on the spot that brings one scan over the other, within a window around what is expected.

    None if the surroundings do not tell: nothing fits, or two turns fit alike.
    """
    one, two = _profile(before), _profile(after)
    step_rad = math.tau / BINS
    shifts = np.arange(math.ceil((expected_rad - window_rad) / step_rad), (expected_rad + window_rad) / step_rad)
    # What was seen at a bearing is seen at that bearing less the turn.
    costs = np.array([_difference(np.roll(one, -int(shift)), two) for shift in shifts])
    if not len(costs) or np.isnan(costs).all():
        return None
    best = int(np.nanargmin(costs))
    if best in (0, len(costs) - 1):  # it would fit better outside
        return None
    others = costs[np.abs(shifts - shifts[best]) * step_rad > APART_RAD]
    if len(others) and np.nanmin(others) < ALIKE * costs[best]:
        return None
    return float((shifts[best] + _vertex(costs, best)) * step_rad)


def _beams(scan: LaserScan) -> tuple[Floats, Floats]:
    """Bearings in [-pi, pi) and ranges; what is too close counts as at the shortest range."""
    angles: Floats = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges), dtype=np.float64)
    ranges: Floats = read_ranges(scan).astype(np.float64)
    ranges[np.isneginf(ranges)] = scan.range_min
    return np.remainder(angles + math.pi, math.tau) - math.pi, ranges


def _profile(scan: LaserScan) -> Floats:
    """Ranges at `BINS` bearings; nan where nothing was seen."""
    angles, ranges = _beams(scan)
    good = np.isfinite(ranges)
    order = np.argsort(angles[good])
    bearings = -math.pi + math.tau / BINS * np.arange(BINS)
    if np.count_nonzero(good) < 2:
        return np.full(BINS, np.nan)
    found: Floats = np.interp(bearings, angles[good][order], ranges[good][order], period=math.tau)
    nearest = np.min(np.abs(np.angle(np.exp(1j * (bearings[:, None] - angles[good][None, :])))), axis=1)
    found[nearest > 2 * abs(scan.angle_increment)] = np.nan
    return found


def _difference(one: Floats, two: Floats) -> float:
    """Mean difference of two profiles, with outliers cut off; nan if too little of them overlaps."""
    differences = np.minimum(np.abs(one - two), OUTLIER_M)
    known = ~np.isnan(differences)
    return float(np.mean(differences[known])) if np.count_nonzero(known) > BINS // 4 else math.nan


def _vertex(costs: Floats, at: int) -> float:
    """Where between its neighbours a minimum really lies, in steps."""
    if not 0 < at < len(costs) - 1 or np.isnan(costs[at - 1 : at + 2]).any():
        return 0.0
    left, middle, right = costs[at - 1 : at + 2]
    bend = left - 2 * middle + right
    return float(0.5 * (left - right) / bend) if bend > 0.0 else 0.0
