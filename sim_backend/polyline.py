"""A curve on the floor, sampled at equal arc length, and where points are relative to it. Pure numpy."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

STEP_M = 0.1
FAR_M = 1e6
# A hint is the progress a moment ago. This is by how many steps it may be off.
WINDOW = 13


@dataclass(frozen=True, slots=True)
class Polyline:
    """Points [n + 1, 2] `step_m` apart along the curve; a closed one repeats its first point at the end.

    `headings` [n + 1] are the tangents, unwrapped. The ends of an open one go on straight for ever.
    """

    points: Floats
    headings: Floats
    step_m: float
    closed: bool
    _tables: "Tables" = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Work out once what every projection looks up."""
        object.__setattr__(self, "_tables", Tables.of(self.points, self.headings, self.closed))

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
        x, y, tables = xy[..., 0], xy[..., 1], self._tables
        vertex = self._nearest_vertex(x, y, hint_m)
        first = vertex % self.segments if self.closed else vertex
        # The nearest place is on the stretch before or after the nearest vertex.
        behind = (x - tables.x[first]) * tables.cos[first] + (y - tables.y[first]) * tables.sin[first] < 0.0
        begin = vertex - behind
        if not self.closed:
            begin = np.minimum(np.maximum(begin, 0), self.segments - 1)
        first = begin % self.segments
        chord_x, chord_y = tables.chord_x[first], tables.chord_y[first]
        off_x, off_y = x - tables.x[first], y - tables.y[first]
        t = (off_x * chord_x + off_y * chord_y) / tables.chord_squared[first]
        on_curve = np.minimum(np.maximum(t, 0.0), 1.0)
        inside = on_curve
        if not self.closed:
            beyond = ((begin == 0) & (t < 0.0)) | ((begin == self.segments - 1) & (t > 1.0))
            inside = np.where(beyond, t, inside)
        distance = np.hypot(off_x - inside * chord_x, off_y - inside * chord_y)
        heading = self.headings[first] + on_curve * tables.turn[first]
        lateral: Floats = np.asarray(np.copysign(distance, chord_x * off_y - chord_y * off_x))
        return np.asarray((begin + inside) * self.step_m), lateral, np.asarray(heading)

    def project_one(self, x: float, y: float, hint_m: float) -> tuple[float, float]:
        """Progress and lateral of one place near `hint_m`: the same to the bit as `project`, and sooner."""
        tables, segments = self._tables, self.segments
        middle = round(hint_m / self.step_m)
        place = middle % segments if self.closed else min(max(middle, -WINDOW), segments + WINDOW)
        around = slice(place + WINDOW, place + 3 * WINDOW + 1)
        gap_x, gap_y = tables.around_x[around] - x, tables.around_y[around] - y
        vertex = (middle if self.closed else place) + int((gap_x * gap_x + gap_y * gap_y).argmin()) - WINDOW
        first = vertex % segments if self.closed else min(max(vertex, 0), segments)
        begin = vertex if self.closed else first
        if (x - tables.x[first]) * tables.cos[first] + (y - tables.y[first]) * tables.sin[first] < 0.0:
            begin -= 1
        if not self.closed:
            begin = min(max(begin, 0), segments - 1)
        first = begin % segments
        chord_x, chord_y = float(tables.chord_x[first]), float(tables.chord_y[first])
        off_x, off_y = x - float(tables.x[first]), y - float(tables.y[first])
        t = (off_x * chord_x + off_y * chord_y) / float(tables.chord_squared[first])
        before, behind = t < 0.0, t > 1.0
        if self.closed or not ((before and begin == 0) or (behind and begin == segments - 1)):
            t = min(max(t, 0.0), 1.0)
        distance = float(np.hypot(off_x - t * chord_x, off_y - t * chord_y))
        return (begin + t) * self.step_m, math.copysign(distance, chord_x * off_y - chord_y * off_x)

    def _nearest_vertex(self, x: Floats, y: Floats, hint_m: Floats | float | None) -> Indices:
        """Index of the nearest vertex [...]; on a closed curve it counts on over the laps."""
        tables, segments = self._tables, self.segments
        if hint_m is None:
            count = segments + (not self.closed)
            gap_x, gap_y = tables.x[:count] - x[..., None], tables.y[:count] - y[..., None]
            everywhere: Indices = (gap_x * gap_x + gap_y * gap_y).argmin(-1)
            return everywhere
        middle = np.rint(np.asarray(hint_m) / self.step_m).astype(np.int64)
        place = middle % segments if self.closed else np.minimum(np.maximum(middle, -WINDOW), segments + WINDOW)
        around = place[..., None] + np.arange(WINDOW, 3 * WINDOW + 1)
        gap_x, gap_y = tables.around_x[around] - x[..., None], tables.around_y[around] - y[..., None]
        nearest = (gap_x * gap_x + gap_y * gap_y).argmin(-1) - WINDOW
        found: Indices = middle + nearest if self.closed else np.minimum(np.maximum(place + nearest, 0), segments)
        return found


@dataclass(frozen=True, slots=True)
class Tables:
    """What projecting onto a curve looks up: by vertex, by stretch, and around each vertex.

    `around_x` and `around_y` begin two windows before the first vertex and end as far behind the last: round a closed
    curve, and standing still at the ends of an open one.
    """

    x: Floats
    y: Floats
    cos: Floats
    sin: Floats
    chord_x: Floats
    chord_y: Floats
    chord_squared: Floats
    turn: Floats
    around_x: Floats
    around_y: Floats

    @staticmethod
    def of(points: Floats, headings: Floats, closed: bool) -> "Tables":
        """Work them out."""
        x, y = np.ascontiguousarray(points.T)
        chord_x, chord_y = np.diff(x), np.diff(y)
        segments = len(points) - 1
        around = np.arange(-2 * WINDOW, segments + 2 * WINDOW + 1)
        around = around % segments if closed else np.clip(around, 0, segments)
        return Tables(
            *(x, y, np.cos(headings), np.sin(headings)),
            *(chord_x, chord_y, chord_x * chord_x + chord_y * chord_y, np.diff(headings)),
            *(x[around], y[around]),
        )


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
