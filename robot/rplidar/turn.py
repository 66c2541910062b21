"""Turns of the lidar: points become scans with beams at fixed angles, in the robot's frame."""

import math
from dataclasses import dataclass

import numpy as np

from lira.hal.messages import FloatArray, LaserScan
from lira.hal.profile import Lidar
from lira.robot.rplidar.points import Floats

# A turn with fewer points than this share of its beams has lost too much to be shown.
LEAST_SHARE = 0.3
# More than half a turn without a point, and nobody knows which turn the next one belongs to.
SLOWEST_HZ = 2.0


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
    """Cuts a stream of points into turns. The first, incomplete one is dropped."""

    def __init__(self, mounting: Mounting) -> None:
        self._mounting = mounting
        self._sign = 1.0 if mounting.mirror else -1.0
        # The unit's angle at which it looks straight behind the robot.
        self._seam_rad = self._sign * (math.pi - mounting.yaw_offset_rad)
        self.restart()

    def restart(self) -> None:
        """Forget the turn that has begun."""
        self._swept_rad: float | None = None
        self._newest_s = -math.inf
        self._pieces: list[tuple[Floats, Floats, Floats]] | None = None

    def add(self, theta_rad: Floats, distance_m: Floats, time_s: Floats) -> list[Turn]:
        """Take points in the order of time, and return the turns that they complete."""
        if not len(theta_rad):
            return []
        if time_s[0] - self._newest_s > 0.5 / SLOWEST_HZ:
            self.restart()
        self._newest_s = float(time_s[-1])
        # Angles since the seam without jumps; to sweep back over the seam does not begin the turn again.
        before = [] if self._swept_rad is None else [self._swept_rad]
        swept = np.unwrap(np.concatenate([before, (theta_rad - self._seam_rad) % math.tau]))
        furthest = np.maximum.accumulate(swept)
        self._swept_rad = float(furthest[-1])
        turns = np.floor(furthest / math.tau)
        first = turns[0]
        turns = turns[len(before) :]
        turned = []
        for number in range(int(first), int(turns[-1]) + 1):
            if number > first:
                turned += self._finish()
            mine = turns == number
            if self._pieces is not None:
                self._pieces.append((theta_rad[mine], distance_m[mine], time_s[mine]))
        # Small numbers stay exact.
        self._swept_rad %= math.tau
        return turned

    def _finish(self) -> list[Turn]:
        """Close the turn at hand, if it was seen from its start, and begin the next."""
        pieces, self._pieces = self._pieces, []
        if not pieces:
            return []
        theta_rad, distance_m, time_s = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        bearing_rad = self._sign * theta_rad + self._mounting.yaw_offset_rad
        return [Turn((bearing_rad + math.pi) % math.tau - math.pi, distance_m, time_s)]


def scan_of(turn: Turn, lidar: Lidar) -> LaserScan | None:
    """Put a turn's points to the profile's beams; None if too few are left of it.

    Of several points in a beam the nearest counts; a beam without one is nan. Ranges after REP-117. The stamp is that
    of the first beam, and `time_increment` is negative where the lidar turns clockwise.
    """
    increment_rad = lidar.increment_rad
    index = np.rint((turn.bearing_rad + lidar.fov_rad / 2) / increment_rad).astype(np.int64)
    if lidar.full_turn:
        index %= lidar.beams
    inside = (index >= 0) & (index < lidar.beams)
    if np.count_nonzero(inside) < LEAST_SHARE * lidar.beams:
        return None
    index, distance_m, time_s = index[inside], turn.distance_m[inside], turn.time_s[inside]
    ranges = np.full(lidar.beams, np.nan)
    np.fmin.at(ranges, index, np.where(distance_m > 0.0, distance_m, np.nan))
    time_increment_s = _slope(turn) * increment_rad
    return LaserScan(
        stamp_s=float(np.mean(time_s - index * time_increment_s)),
        angle_min=-lidar.fov_rad / 2,
        angle_increment=increment_rad,
        range_min=lidar.range_min_m,
        range_max=lidar.range_max_m,
        ranges=_rep117(ranges, lidar),
        scan_time=float(turn.time_s[-1] - turn.time_s[0]),
        time_increment=time_increment_s,
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
