"""Turns of the lidar: points become scans with beams at fixed angles, in the robot's frame."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import FloatArray, LaserScan
from lira.hal.profile import Lidar
from lira.robot.rplidar.points import FASTEST_HZ, LONGEST_SAMPLE_S, Floats

# A turn that shows less than this share of its beams has lost too much to be shown.
LEAST_SHARE = 0.5
# More than half a turn without a point, and nobody knows which turn the next one belongs to.
SLOWEST_HZ = 2.0
# Points do not lie further apart than this; what is wider is a hole.
WIDEST_RAD = math.tau * FASTEST_HZ * LONGEST_SAMPLE_S


@dataclass(frozen=True, slots=True)
class Mounting:
    """How the unit sits on the robot.

    A point at the unit's clockwise angle theta lies at `yaw_offset_rad` - theta from the robot's x, counter-clockwise.
    An unit that hangs upside down is mirrored: there it is `yaw_offset_rad` + theta.
    """

    yaw_offset_rad: float = 0.0
    mirror: bool = False


@dataclass(frozen=True, slots=True)
class Turn:
    """One turn, cut behind the robot. Arrays [n] in the order of time; `bearing_rad` in [-pi, pi), 0 m is invalid."""

    bearing_rad: Floats
    distance_m: Floats
    time_s: Floats


class TurnCutter:
    """Cuts a stream of points into turns. The first, incomplete one is dropped.

    `back_rad`: how far the angles of a stream may step back. A turn is closed when the head is so far past the seam.
    """

    def __init__(self, mounting: Mounting, back_rad: float = 0.0) -> None:
        self._mounting = mounting
        self._back_rad = back_rad
        self._sign = 1.0 if mounting.mirror else -1.0
        # The unit's angle at which it looks straight behind the robot.
        self._seam_rad = self._sign * (math.pi - mounting.yaw_offset_rad)
        self.restart()

    def restart(self) -> None:
        """Forget the turn that has begun."""
        self._swept_rad: float | None = None  # of the newest point, since the seam at which the turn at hand began
        self._furthest_rad = 0.0
        self._newest_s = -math.inf
        self._whole = False  # the turn at hand was seen from its start
        self._pieces: list[Turn] = []  # of the turn at hand
        self._early: list[Turn] = []  # of the next one

    @property
    def swept_rad(self) -> float:
        """How far the head has come since the turn at hand began."""
        return self._furthest_rad

    def add(self, theta_rad: Floats, distance_m: Floats, time_s: Floats) -> list[Turn]:
        """Take points in the order of time, and return the turns that they complete."""
        if not len(theta_rad):
            return []
        if time_s[0] - self._newest_s > 0.5 / SLOWEST_HZ:
            self.restart()
        self._newest_s = float(time_s[-1])
        # Angles since the seam without jumps; to sweep back over the seam does not begin the turn again.
        before = [] if self._swept_rad is None else [self._swept_rad]
        swept = np.unwrap(np.concatenate([before, (theta_rad - self._seam_rad) % math.tau]))[len(before) :]
        bearing_rad = self._sign * theta_rad + self._mounting.yaw_offset_rad
        points = Turn((bearing_rad + math.pi) % math.tau - math.pi, distance_m, time_s)
        if swept[-1] < -math.pi:  # heads do not turn back: what came between was none of it
            self.restart()
            return []
        furthest_rad, swept_rad = max(self._furthest_rad, float(swept.max())), float(swept[-1])
        turned = []
        while furthest_rad >= math.tau + self._back_rad:
            mine = swept < math.tau
            self._pieces.append(_some(points, mine))
            turned += self._finish()
            points, swept = _some(points, ~mine), swept[~mine] - math.tau
            furthest_rad, swept_rad = furthest_rad - math.tau, swept_rad - math.tau
        mine = swept < math.tau
        self._pieces.append(_some(points, mine))
        self._early.append(_some(points, ~mine))
        self._furthest_rad, self._swept_rad = furthest_rad, swept_rad
        return turned

    def _finish(self) -> list[Turn]:
        """Close the turn at hand, if it was seen from its start, and begin the next."""
        pieces, self._pieces, self._early = self._pieces, self._early, []
        whole, self._whole = self._whole, True
        return [_together(pieces)] if whole else []


def _some(turn: Turn, which: NDArray[np.bool_]) -> Turn:
    return Turn(turn.bearing_rad[which], turn.distance_m[which], turn.time_s[which])


def _together(pieces: list[Turn]) -> Turn:
    names = ("bearing_rad", "distance_m", "time_s")
    return Turn(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in names))


def scan_of(turn: Turn, lidar: Lidar, *, ascending_time: bool = False) -> LaserScan | None:
    """Put a turn's points to the profile's beams; None if too much of it is missing.

    Of several returns in a beam the nearest counts. A beam that no return fell into has the nearer of those beside it,
    no further away than points or beams lie apart: there are beams between the points of a slow mode. What is left is
    nan: there the unit has measured nothing, or its points were lost. Ranges after REP-117.

    The stamp is that of the first beam. The lidar turns clockwise, so that `time_increment` is negative; with
    `ascending_time` it is positive, and `angle_increment` is negative.
    """
    increment_rad = lidar.increment_rad
    index = np.rint((turn.bearing_rad + lidar.fov_rad / 2) / increment_rad).astype(np.int64)
    if lidar.full_turn:
        index %= lidar.beams
    inside = (index >= 0) & (index < lidar.beams)
    if not inside.any():
        return None
    middle_rad: Floats = -lidar.fov_rad / 2 + increment_rad * np.arange(lidar.beams, dtype=np.float64)
    reach_rad = max(2 * increment_rad, 1.5 * min(math.tau / len(index), WIDEST_RAD))
    seen = np.isfinite(nearest_beside(turn.bearing_rad, np.ones(len(index)), middle_rad, reach_rad))
    if np.count_nonzero(seen) < LEAST_SHARE * lidar.beams:
        return None
    returns = turn.distance_m > 0.0
    ranges = np.full(lidar.beams, np.nan)
    fell = inside & returns
    np.fmin.at(ranges, index[fell], turn.distance_m[fell])
    empty = np.isnan(ranges)
    ranges[empty] = nearest_beside(turn.bearing_rad[returns], turn.distance_m[returns], middle_rad[empty], reach_rad)
    time_increment_s = _slope(turn) * increment_rad
    stamp_s = float(np.mean(turn.time_s[inside] - index[inside] * time_increment_s))
    newest_s = stamp_s + max(0.0, (lidar.beams - 1) * time_increment_s)
    scan = LaserScan(
        stamp_s=stamp_s - max(0.0, newest_s - float(turn.time_s[-1])),  # no beam was measured after the last point
        angle_min=-lidar.fov_rad / 2,
        angle_increment=increment_rad,
        range_min=lidar.range_min_m,
        range_max=lidar.range_max_m,
        ranges=_rep117(ranges, lidar),
        scan_time=float(turn.time_s[-1] - turn.time_s[0]),
        time_increment=time_increment_s,
    )
    return reverse(scan) if ascending_time and time_increment_s < 0.0 else scan


def nearest_beside(bearing_rad: Floats, distance_m: Floats, middle_rad: Floats, reach_rad: float) -> Floats:
    """Of the points [n] next to each direction [m], left and right, the nearer one's distance; nan beyond reach."""
    if not len(bearing_rad):
        return np.full(len(middle_rad), np.nan)
    order = np.argsort(bearing_rad)
    bearing_rad, distance_m = bearing_rad[order], distance_m[order]
    after = np.searchsorted(bearing_rad, middle_rad)
    found = np.full(len(middle_rad), np.nan)
    for beside in (after - 1, after % len(bearing_rad)):
        apart_rad = np.abs((bearing_rad[beside] - middle_rad + math.pi) % math.tau - math.pi)
        found = np.fmin(found, np.where(apart_rad <= reach_rad, distance_m[beside], np.nan))
    return found


def reverse(scan: LaserScan) -> LaserScan:
    """The same scan with its beams in the other order."""
    last = len(scan.ranges) - 1
    return replace(
        scan,
        stamp_s=scan.stamp_s + last * scan.time_increment,
        angle_min=scan.angle_min + last * scan.angle_increment,
        angle_increment=-scan.angle_increment,
        ranges=np.ascontiguousarray(scan.ranges[::-1]),
        time_increment=-scan.time_increment,
    )


def _slope(turn: Turn) -> float:
    """Seconds per radian of bearing, counter-clockwise."""
    span_s = float(turn.time_s[-1] - turn.time_s[0])
    bearing_rad = np.unwrap(turn.bearing_rad)  # a point at the seam may lie on either side of it
    span_rad = float(bearing_rad[-1] - bearing_rad[0])
    return span_s / span_rad if abs(span_rad) > math.pi else 0.0


def _rep117(ranges_m: Floats, lidar: Lidar) -> FloatArray:
    """Name what lies outside the lidar's reach; nan stays nan."""
    ranges = np.where(ranges_m > lidar.range_max_m, math.inf, ranges_m)
    return np.where(ranges < lidar.range_min_m, -math.inf, ranges).astype(np.float32)
