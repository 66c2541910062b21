"""A curve on the floor, sampled at equal arc length, and where points are relative to it. Pure numpy."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

STEP_M = 0.1
FAR_M = 1e6
# A hint is the progress a moment ago. This is how far it may be off.
WINDOW_M = 1.2


@dataclass(frozen=True, slots=True)
class Polyline:
    """Points [n + 1, 2] `step_m` apart along the curve; a closed one repeats its first point at the end.

    `headings` [n + 1] are the tangents, unwrapped. The ends of an open one go on straight for ever.
    """

    points: Floats
    headings: Floats
    step_m: float
    closed: bool

    @property
    def segments(self) -> int:
        """Number of chords."""
        return len(self.points) - 1

    @property
    def length_m(self) -> float:
        """Arc length."""
        return self.segments * self.step_m

    def pose(self, progress_m: float, lateral_m: float = 0.0) -> tuple[float, float, float]:
        """x, y and heading of the place `progress_m` along and `lateral_m` to the left.

        Raises `ValueError` for a place that is on no floor.
        """
        if not max(abs(progress_m), abs(lateral_m)) <= FAR_M:  # which nan is not
            raise ValueError(f"{progress_m} m along and {lateral_m} m beside the line there is no floor")
        at = progress_m / self.step_m
        index = math.floor(at) % self.segments if self.closed else min(max(math.floor(at), 0), self.segments - 1)
        t = at - math.floor(at) if self.closed else at - index
        x, y = self.points[index] + t * (self.points[index + 1] - self.points[index])
        inside = min(max(t, 0.0), 1.0)
        heading = float(self.headings[index] + inside * (self.headings[index + 1] - self.headings[index]))
        return (
            float(x) - lateral_m * math.sin(heading),
            float(y) + lateral_m * math.cos(heading),
            math.remainder(heading, math.tau),
        )

    def project(self, xy: Floats, hint_m: Floats | float | None = None) -> tuple[Floats, Floats, Floats]:
        """Nearest place on the curve to each of `xy` [..., 2]: progress [...], lateral [...], heading [...].

        With `hint_m` [...], or one for all, only the curve around that progress is looked at: where a figure-eight
        crosses itself the branch being driven is kept, and progress goes on growing over the laps of a closed curve.
        """
        x, y = xy[..., 0], xy[..., 1]
        vertex = self._nearest_vertex(x, y, hint_m)
        first = vertex % self.segments if self.closed else vertex
        heading = self.headings[first]
        # The nearest place is on the stretch before or after the nearest vertex.
        behind = (x - self.points[first, 0]) * np.cos(heading) + (y - self.points[first, 1]) * np.sin(heading) < 0.0
        begin = vertex - behind
        if not self.closed:
            begin = np.clip(begin, 0, self.segments - 1)
        first = begin % self.segments
        chord_x, chord_y = (self.points[first + 1] - self.points[first]).T
        off_x, off_y = x - self.points[first, 0], y - self.points[first, 1]
        t = (off_x * chord_x + off_y * chord_y) / (chord_x * chord_x + chord_y * chord_y)
        inside = np.clip(t, 0.0, 1.0)
        if not self.closed:
            beyond = ((begin == 0) & (t < 0.0)) | ((begin == self.segments - 1) & (t > 1.0))
            inside = np.where(beyond, t, inside)
        distance = np.hypot(off_x - inside * chord_x, off_y - inside * chord_y)
        heading = self.headings[first] + np.clip(inside, 0.0, 1.0) * (self.headings[first + 1] - self.headings[first])
        lateral = np.copysign(distance, chord_x * off_y - chord_y * off_x)
        return (begin + inside) * self.step_m, lateral, heading

    def _nearest_vertex(self, x: Floats, y: Floats, hint_m: Floats | float | None) -> Indices:
        """Index of the nearest vertex [...]; on a closed curve it counts on over the laps."""
        if hint_m is None:
            near = np.arange(self.segments + (not self.closed))
        else:
            reach = math.ceil(WINDOW_M / self.step_m)
            middle = np.rint(np.asarray(hint_m) / self.step_m).astype(np.int64)
            near = middle[..., None] + np.arange(-reach, reach + 1)
            if not self.closed:
                near = np.clip(near, 0, self.segments)
        wrapped = near % self.segments if self.closed else near
        gap_x, gap_y = self.points[wrapped, 0] - x[..., None], self.points[wrapped, 1] - y[..., None]
        best = (gap_x * gap_x + gap_y * gap_y).argmin(-1)
        near = np.broadcast_to(near, gap_x.shape)
        vertex: Indices = np.take_along_axis(near, best[..., None], -1)[..., 0]
        return vertex


def resample(points: Floats, closed: bool) -> Polyline:
    """Sample a finely drawn curve [m, 2] at equal steps of its arc length."""
    if closed:
        points = np.concatenate([points, points[:1]])
    along = np.concatenate([[0.0], np.hypot(*np.diff(points, axis=0).T).cumsum()])
    segments = max(round(along[-1] / STEP_M), 2)
    at = np.linspace(0.0, along[-1], segments + 1)
    sampled = np.stack([np.interp(at, along, points[:, axis]) for axis in (0, 1)], axis=-1)
    chords = np.diff(sampled, axis=0)
    turns = np.unwrap(np.arctan2(chords[:, 1], chords[:, 0]))
    if closed:
        # The last chord runs into the first one: the seam is a bend like any other.
        padded = np.unwrap(np.concatenate([turns[-1:], turns, turns[:1]]))
    else:
        padded = np.concatenate([turns[:1], turns, turns[-1:]])
    headings = (padded[:-1] + padded[1:]) / 2
    return Polyline(sampled, headings, float(along[-1]) / segments, closed)
