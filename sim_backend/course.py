"""The referee's geometry: where poses are on the course, how near to a box, and what that means. Pure numpy."""

import math
from dataclasses import dataclass

import numpy as np

from hal.profile import Base
from sim_backend.layout import Layout
from sim_backend.polyline import Floats


@dataclass(frozen=True, slots=True)
class Place:
    """Relative to the course, arrays of one shape: metres along it, metres left of it, yaw minus its heading."""

    progress_m: Floats
    lateral_m: Floats
    heading_error_rad: Floats


class Course:
    """A layout as a robot of radius `radius_m` (the half diagonal of its footprint) meets it."""

    def __init__(self, layout: Layout, radius_m: float) -> None:
        self.layout = layout
        self.radius_m = radius_m
        self.limits = layout.world.limits
        self.has_line = layout.world.line is not None
        blocks = layout.blocks
        self._centre = np.array([(b.x_m, b.y_m) for b in blocks], dtype=np.float64).reshape(-1, 2)
        self._half = np.array([(b.length_m, b.width_m) for b in blocks], dtype=np.float64).reshape(-1, 2) / 2
        yaw = np.array([b.yaw_rad for b in blocks], dtype=np.float64)
        # World to box: a row vector of offsets times this, one matrix per box.
        self._turn = np.stack([np.cos(yaw), -np.sin(yaw), np.sin(yaw), np.cos(yaw)], axis=-1).reshape(-1, 2, 2)

    def clearance(self, xy: Floats) -> Floats:
        """Metres between the robot's disc at each of `xy` [..., 2] and the nearest box; below 0 it is inside."""
        if not len(self._centre):
            return np.full(xy.shape[:-1], np.inf)
        offset = xy[..., None, None, :] - self._centre[:, None, :]
        outside = np.abs((offset @ self._turn)[..., 0, :]) - self._half
        positive = np.maximum(outside, 0.0)
        distance = np.hypot(positive[..., 0], positive[..., 1]) + np.minimum(outside.max(-1), 0.0)
        nearest: Floats = distance.min(-1) - self.radius_m
        return nearest

    def place(self, xy: Floats, yaw_rad: Floats, hint_m: Floats | float | None = None) -> Place:
        """Project poses, xy [..., 2] and yaw [...], near the progress `hint_m` (see `Polyline.project`)."""
        progress, lateral, heading = self.layout.curve.project(xy, hint_m)
        error = np.remainder(yaw_rad - heading + math.pi, math.tau) - math.pi
        return Place(progress, lateral, error)

    def lost(self, lateral_m: Floats) -> Floats:
        """Tell where the line is too far away, [...] of bool."""
        too_far: Floats = np.abs(lateral_m) > self.limits.lost_m
        return too_far

    def finished(self, progress_m: float, start_m: float) -> bool:
        """Tell whether a drive that began at `start_m` is over."""
        if self.limits.finish_m is not None:
            return progress_m >= self.limits.finish_m
        return progress_m - start_m >= self.limits.laps * self.layout.curve.length_m

    def start_pose(self, start_m: float, lateral_m: float, yaw_rad: float) -> tuple[float, float, float]:
        """Pose of a start relative to the course."""
        x, y, heading = self.layout.curve.pose(start_m, lateral_m)
        return x, y, math.remainder(heading + yaw_rad, math.tau)


def footprint_radius_m(base: Base) -> float:
    """Half the diagonal of the robot's footprint: a disc that covers it at any yaw."""
    return math.hypot(base.length_m, base.width_m) / 2
