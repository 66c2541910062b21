"""A curve on the floor, sampled at equal arc length, and where points are relative to it. Pure numpy."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEP_M = 0.1
# A hint is the progress a moment ago. This is how far it may be off.
WINDOW_M = 1.5


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
        """x, y and heading of the place `progress_m` along and `lateral_m` to the left."""
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

        With `hint_m` [...] or one for all only the curve around that progress is looked at: where a figure-eight crosses
        itself the branch being driven is kept, and progress goes on growing over the laps of a closed curve.
        """
        if hint_m is None:
            index = np.broadcast_to(np.arange(self.segments), (*xy.shape[:-1], self.segments))
        else:
            reach = math.ceil(WINDOW_M / self.step_m)
            middle = np.floor(np.asarray(hint_m) / self.step_m).astype(np.int64)
            if not self.closed:
                middle = np.clip(middle, 0, self.segments - 1)
            index = np.broadcast_to(middle, xy.shape[:-1])[..., None] + np.arange(-reach, reach + 1)
            if not self.closed:
                index = np.clip(index, 0, self.segments - 1)
        wrapped = index % self.segments
        begin = self.points[wrapped]
        chord = self.points[wrapped + 1] - begin
        offset = xy[..., None, :] - begin
        t = (offset * chord).sum(-1) / (chord * chord).sum(-1)
        low = 0.0 if self.closed else np.where(wrapped == 0, -np.inf, 0.0)
        high = 1.0 if self.closed else np.where(wrapped == self.segments - 1, np.inf, 1.0)
        t = np.clip(t, low, high)
        miss = offset - t[..., None] * chord
        distance = np.hypot(miss[..., 0], miss[..., 1])
        best = distance.argmin(-1)[..., None]

        def pick(values: Floats) -> Floats:
            return np.take_along_axis(values, best, -1)[..., 0]

        side = pick(chord[..., 0] * offset[..., 1] - chord[..., 1] * offset[..., 0])
        inside = np.clip(pick(t), 0.0, 1.0)
        first = pick(wrapped)
        heading = self.headings[first] + inside * (self.headings[first + 1] - self.headings[first])
        return (pick(index) + pick(t)) * self.step_m, np.copysign(pick(distance), side), heading


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
