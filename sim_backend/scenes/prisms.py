"""The boxes of a layout as arrays: what of them faces an eye, which is in front of which, and what rays meet."""

import math
from collections.abc import Iterable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lira.sim_backend.layout import Block
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.meshes import BOX_FACES, Indices, box_mesh

Flags = NDArray[np.bool_]

TOUCHING_M = 1e-9


class Prisms:
    """Upright boxes, all in one: arrays of [boxes, ...]."""

    def __init__(self, blocks: tuple[Block, ...]) -> None:
        rows = [(b.x_m, b.y_m, b.yaw_rad, b.length_m, b.width_m, b.bottom_m, b.height_m, b.gray) for b in blocks]
        x, y, yaw, length, width, bottom, height, gray = np.array(rows, dtype=np.float64).reshape(-1, 8).T
        self.gray: Indices = gray.astype(np.intp)
        self.corners: Floats = np.array([box_mesh(block)[0] for block in blocks]).reshape(-1, 8, 3)
        # Indices of the corners of all boxes, one box after the other.
        self.faces: Indices = BOX_FACES + 8 * np.arange(len(blocks))[:, None, None]
        self._x, self._y, self._cos, self._sin = x, y, np.cos(yaw), np.sin(yaw)
        self._half_length, self._half_width = length / 2, width / 2
        self._size_m = np.hypot(length, width) / 2
        self._bottom, self._top = bottom, bottom + height

    def facing(self, eye: Floats) -> Flags:
        """Which faces an eye at [3] looks at from outside, [boxes, 6] as in `BOX_FACES`."""
        along, across = self._to_own(eye[0], eye[1])
        beyond = (
            *(along < -self._half_length, along > self._half_length),
            *(across < -self._half_width, across > self._half_width),
            *(eye[2] < self._bottom, eye[2] > self._top),
        )
        return np.stack(beyond, axis=1)

    def far_to_near(self, chosen: Indices, facing: Flags, eye: Floats) -> Iterable[Indices]:
        """Sort boxes into an order to paint them in: groups of one gray, each over those before it.

        Two boxes that do not overlap have a face of one of them between them: if the eye is beyond it, too, the other
        box is in front. Boxes that overlap, or hide each other in a ring, are taken by their distance.
        """
        gray = self.gray[chosen]
        if not len(chosen) or (gray == gray[0]).all():
            yield chosen
            return
        away_m = np.hypot(self._x[chosen] - eye[0], self._y[chosen] - eye[1])
        left = chosen[np.argsort(-away_m, kind="stable")]
        beyond, seen = self._beyond[left][:, :, left], facing[left][:, :, None]
        in_front, behind = np.any(beyond & seen, axis=1), np.any(beyond & ~seen, axis=1)  # [i, j]: j is not otherwise
        waits: Flags = ~(in_front | behind.T) & (in_front.T | behind)
        while len(left):
            ready = ~np.any(waits, axis=1)
            first = left[np.argmax(ready)]  # the farthest, if each waits for another
            taken: Flags = (ready | (left == first)) & (self.gray[left] == self.gray[first])
            yield left[taken]
            left, waits = left[~taken], waits[~taken][:, ~taken]

    @cached_property
    def _beyond(self) -> Flags:
        """Which boxes lie beyond which faces of which, [i, face, j]: all of j is on the outer side of i's face."""
        x, y, z = self.corners.transpose(2, 0, 1)
        count = len(self.gray)
        flags: Flags = np.empty((count, 6, count), dtype=np.bool_)
        for i in range(count):
            off_x, off_y = x - self._x[i], y - self._y[i]
            along, across = (
                self._cos[i] * off_x + self._sin[i] * off_y,
                self._cos[i] * off_y - self._sin[i] * off_x,
            )
            places = ((along, self._half_length[i]), (across, self._half_width[i]))
            for axis, (place, half) in enumerate(places):
                flags[i, 2 * axis] = (place <= TOUCHING_M - half).all(1)
                flags[i, 2 * axis + 1] = (place >= half - TOUCHING_M).all(1)
            flags[i, 4] = (z <= self._bottom[i] + TOUCHING_M).all(1)
            flags[i, 5] = (z >= self._top[i] - TOUCHING_M).all(1)
        return flags

    def ranges_m(self, origin: tuple[float, float, float], angles_rad: Floats, reach_m: float) -> Floats:
        """Distances to the first box along level rays [n] from one point; infinite beyond `reach_m`."""
        x, y, z = origin
        met = np.hypot(self._x - x, self._y - y) - self._size_m <= reach_m
        met &= (self._bottom <= z) & (z <= self._top)
        directions = np.stack([np.cos(angles_rad), np.sin(angles_rad), np.zeros(len(angles_rad))])
        free = self.distances_m(np.array(origin), directions, np.flatnonzero(met))
        return np.where(free <= reach_m, free, math.inf)

    def distances_m(self, eye: Floats, directions: Floats, chosen: Indices) -> Floats:
        """How many times each of the directions [3, n] it is from a point to the first of some boxes: [n]."""
        nearest = np.full(directions.shape[1], math.inf)
        along, across = self._to_own(eye[0], eye[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            for i in chosen.tolist():
                cos, sin = self._cos[i], self._sin[i]
                enter, leave = 0.0, math.inf
                for at, way, low, high in (
                    (along[i], cos * directions[0] + sin * directions[1], -self._half_length[i], self._half_length[i]),
                    (across[i], cos * directions[1] - sin * directions[0], -self._half_width[i], self._half_width[i]),
                    (eye[2], directions[2], self._bottom[i], self._top[i]),
                ):
                    one, other = (low - at) / way, (high - at) / way
                    enter, leave = np.fmax(enter, np.fmin(one, other)), np.fmin(leave, np.fmax(one, other))
                nearest = np.where(enter <= leave, np.minimum(nearest, enter), nearest)
        return nearest

    def _to_own(self, x: float, y: float) -> tuple[Floats, Floats]:
        """A place along and across each box, from its middle: [boxes] each."""
        off_x, off_y = x - self._x, y - self._y
        return self._cos * off_x + self._sin * off_y, self._cos * off_y - self._sin * off_x
