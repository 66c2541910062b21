"""The protective field: how free the way is, from a scan, and what that allows. Pure."""

import math
from dataclasses import dataclass

import numpy as np

from lira.hal.clock import is_fresh
from lira.hal.messages import LaserScan
from lira.hal.messages.ranges import read_ranges
from lira.hal.profile import Field, RobotProfile

CONE_RAD = math.radians(30.0)  # to each side of the direction of motion: here the lidar must really see
SEEN = 0.75  # share of the beams in that cone that must say something


@dataclass(frozen=True, slots=True)
class Clearance:
    """Free ground before and behind the body, in metres, at `stamp_s`. 0 where the lidar should see and does not."""

    stamp_s: float
    ahead_m: float
    behind_m: float


def measure_clearance(profile: RobotProfile, field: Field, scan: LaserScan) -> Clearance:
    """Find the nearest point in the way, either way.

    What is too close for the lidar counts as at its shortest range, and is in the way to where its beam looks. Where
    the lidar does not look at all (behind a sector) the way counts as free.
    """
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    ranges = read_ranges(scan)
    too_close = np.isneginf(ranges)
    ranges[too_close] = scan.range_min
    near_m = np.where(np.isfinite(ranges), ranges, np.nan)  # nothing there is nothing in the way
    ahead_m, left_m = near_m * np.cos(angles), near_m * np.sin(angles)
    x_m = profile.lidar.x_m + ahead_m
    side_m = np.where(too_close, np.cos(angles), x_m)  # its sign says on which side it is in the way
    in_the_way = np.abs(left_m) <= profile.base.width_m / 2 + field.margin_m

    def free_m(sign: int) -> float:
        if _is_blind(profile, angles if sign > 0 else angles - math.pi, ranges, sign):
            return 0.0
        distances_m = (sign * x_m)[in_the_way & (sign * side_m >= 0.0)]
        return max(float(distances_m.min(initial=math.inf)) - profile.base.length_m / 2, 0.0)

    return Clearance(scan.stamp_s, free_m(1), free_m(-1))


def _is_blind(profile: RobotProfile, angles: np.ndarray, ranges: np.ndarray, sign: int) -> bool:
    lidar = profile.lidar
    in_cone = np.abs(np.remainder(angles + math.pi, math.tau) - math.pi) <= CONE_RAD
    seen = int(np.count_nonzero(in_cone & ~np.isnan(ranges)))
    half_fov = lidar.fov_rad / 2
    cone_rad = min(half_fov, CONE_RAD) if sign > 0 else max(half_fov - (math.pi - CONE_RAD), 0.0)
    return seen < SEEN * 2 * cone_rad / lidar.fov_rad * lidar.beams


def limit_speed(field: Field, clearance: Clearance | None, linear_m_s: float, now_s: float) -> tuple[float, str]:
    """Return the speed that the field allows and the name of what cut it, "" for nothing."""
    if linear_m_s == 0.0:
        return 0.0, ""
    if clearance is None or not is_fresh(clearance.stamp_s, now_s, field.max_age_s):
        return 0.0, "field_blind"
    free_m = clearance.ahead_m if linear_m_s > 0.0 else clearance.behind_m
    if free_m < field.stop_m:
        return 0.0, "field_stop"
    if free_m < field.slow_m and abs(linear_m_s) > field.slow_m_s:
        return math.copysign(field.slow_m_s, linear_m_s), "field_slow"
    return linear_m_s, ""
