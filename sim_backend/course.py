"""The referee's geometry: where poses are on the course, how near to a box, and what that means. Pure numpy."""

import math
from dataclasses import dataclass

import numpy as np

from lira.hal.profile import Base
from lira.sim_backend.layout import Block, Layout
from lira.sim_backend.polyline import Floats


@dataclass(frozen=True, slots=True)
class Place:
    """Relative to the course, arrays of one shape: metres along it, metres left of it, yaw minus its heading."""

    progress_m: Floats
    lateral_m: Floats
    heading_error_rad: Floats


@dataclass(frozen=True, slots=True)
class Obstacles:
    """The boxes in the robot's way as arrays [boxes]: centre, half edges, direction of the length."""

    x_m: Floats
    y_m: Floats
    half_length_m: Floats
    half_width_m: Floats
    cos: Floats
    sin: Floats

    @staticmethod
    def of(blocks: tuple[Block, ...]) -> "Obstacles":
        """Take what matters of the boxes; the robot drives below those that hang high enough."""
        rows = [
            (b.x_m, b.y_m, b.length_m / 2, b.width_m / 2, math.cos(b.yaw_rad), math.sin(b.yaw_rad))
            for b in blocks
            if b.in_the_way
        ]
        return Obstacles(*np.array(rows, dtype=np.float64).reshape(-1, 6).T)

    def near(self, x_m: float, y_m: float, reach_m: float) -> "Obstacles":
        """Only the boxes that may have a part within `reach_m` of a point, however long they are."""
        size_m = np.hypot(self.half_length_m, self.half_width_m)
        kept = np.hypot(self.x_m - x_m, self.y_m - y_m) <= reach_m + size_m
        return Obstacles(
            *(self.x_m[kept], self.y_m[kept], self.half_length_m[kept], self.half_width_m[kept]),
            *(self.cos[kept], self.sin[kept]),
        )

    def distance(self, xy: Floats) -> Floats:
        """Metres from each of `xy` [..., 2] to the nearest outline, below 0 inside, +inf without boxes."""
        if not len(self.x_m):
            return np.full(xy.shape[:-1], np.inf)
        off_x, off_y = xy[..., 0, None] - self.x_m, xy[..., 1, None] - self.y_m
        along = np.abs(self.cos * off_x + self.sin * off_y) - self.half_length_m
        across = np.abs(self.cos * off_y - self.sin * off_x) - self.half_width_m
        outside = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
        nearest: Floats = (outside + np.minimum(np.maximum(along, across), 0.0)).min(-1)
        return nearest

    def free_ahead(self, x_m: Floats, y_m: Floats, yaw_rad: Floats, half_width_m: float) -> Floats:
        """Metres from each place [...] straight ahead until a body of this width meets a box; +inf if it meets none.

        What it meets first is a box at one of its sides, or a corner between them.
        """
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        left, right = (
            self.straight_ahead(x_m - side_m * sin, y_m + side_m * cos, yaw_rad)
            for side_m in (half_width_m, -half_width_m)
        )
        corner_x, corner_y = self._corners
        off_x, off_y = corner_x - x_m[..., None], corner_y - y_m[..., None]
        along = cos[..., None] * off_x + sin[..., None] * off_y
        across = cos[..., None] * off_y - sin[..., None] * off_x
        in_the_way = (np.abs(across) <= half_width_m) & (along >= 0.0)
        corner: Floats = np.where(in_the_way, along, np.inf).min(-1, initial=np.inf)
        return np.minimum(np.minimum(left, right), corner)

    @property
    def _corners(self) -> tuple[Floats, Floats]:
        """Where the corners of all boxes are, each [4 * boxes]."""
        along = np.multiply.outer((1.0, 1.0, -1.0, -1.0), self.half_length_m)
        across = np.multiply.outer((1.0, -1.0, 1.0, -1.0), self.half_width_m)
        x_m = self.x_m + self.cos * along - self.sin * across
        y_m = self.y_m + self.sin * along + self.cos * across
        return x_m.reshape(-1), y_m.reshape(-1)

    def straight_ahead(self, x_m: Floats, y_m: Floats, yaw_rad: Floats) -> Floats:
        """Metres from each place [...] to where a straight drive first meets a box: 0 inside, +inf if it meets none."""
        if not len(self.x_m):
            return np.full(x_m.shape, np.inf)
        off_x, off_y = x_m[..., None] - self.x_m, y_m[..., None] - self.y_m
        cos, sin = np.cos(yaw_rad)[..., None], np.sin(yaw_rad)[..., None]
        enters, leaves = np.asarray(-np.inf), np.asarray(np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):  # parallel to a side
            for at, along, half in (
                (self.cos * off_x + self.sin * off_y, self.cos * cos + self.sin * sin, self.half_length_m),
                (self.cos * off_y - self.sin * off_x, self.cos * sin - self.sin * cos, self.half_width_m),
            ):
                one, other = (-half - at) / along, (half - at) / along
                enters = np.fmax(enters, np.fmin(one, other))
                leaves = np.fmin(leaves, np.fmax(one, other))
        met = (enters <= leaves) & (leaves >= 0.0)
        nearest: Floats = np.where(met, np.maximum(enters, 0.0), np.inf).min(-1)
        return nearest

    def distance_one(self, x_m: float, y_m: float) -> float:
        """Distance of one place: the same to the bit as `distance`, and sooner."""
        if not len(self.x_m):
            return math.inf
        off_x, off_y = x_m - self.x_m, y_m - self.y_m
        along = np.abs(self.cos * off_x + self.sin * off_y) - self.half_length_m
        across = np.abs(self.cos * off_y - self.sin * off_x) - self.half_width_m
        outside = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
        return float((outside + np.minimum(np.maximum(along, across), 0.0)).min())


class Course:
    """A layout as a robot of radius `radius_m` (the half diagonal of its footprint) meets it."""

    def __init__(self, layout: Layout, radius_m: float) -> None:
        self.layout = layout
        self.radius_m = radius_m
        self.limits = layout.world.limits
        self.has_line = layout.world.line is not None
        self.obstacles = Obstacles.of(layout.blocks)

    def clearance(self, xy: Floats) -> Floats:
        """Metres between the robot's disc at each of `xy` [..., 2] and the nearest box; below 0 it is inside."""
        return self.obstacles.distance(xy) - self.radius_m

    def clearance_one(self, x_m: float, y_m: float) -> float:
        """Clearance at one place: the same to the bit as `clearance`, and sooner."""
        return self.obstacles.distance_one(x_m, y_m) - self.radius_m

    def place(self, xy: Floats, yaw_rad: Floats, hint_m: Floats | float | None = None) -> Place:
        """Project poses, xy [..., 2] and yaw [...], near the progress `hint_m` (see `Polyline.project`)."""
        progress, lateral, heading = self.layout.curve.project(xy, hint_m)
        error = np.remainder(yaw_rad - heading + math.pi, math.tau) - math.pi
        return Place(progress, lateral, error)

    def lost(self, lateral_m: float, clearance_m: float) -> bool:
        """Tell whether the line is too far away."""
        limits, off_m = self.limits, abs(lateral_m)
        strayed = limits.stray_m is not None and off_m > limits.stray_m and clearance_m > limits.free_m
        return off_m > limits.lost_m or strayed

    def finished(self, progress_m: float, began_m: float) -> bool:
        """Tell whether a drive that began at `began_m` is over."""
        if self.limits.finish_m is not None:
            return progress_m >= self.limits.finish_m
        return progress_m - began_m >= self.limits.laps * self.layout.curve.length_m

    def start_pose(self, start_m: float, lateral_m: float, yaw_rad: float) -> tuple[float, float, float]:
        """Pose of a start relative to the course."""
        x, y, heading = self.layout.curve.pose(start_m, lateral_m)
        return x, y, math.remainder(heading + yaw_rad, math.tau)


def footprint_radius_m(base: Base) -> float:
    """Half the diagonal of the robot's footprint: a disc that covers it at any yaw."""
    return math.hypot(base.length_m, base.width_m) / 2
