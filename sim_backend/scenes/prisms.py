"""The boxes of a layout as arrays: which is in front of which, and where rays meet them."""

import math
from collections.abc import Iterable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lira.sim_backend.layout import Block
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.shapes import Indices, box_mesh

Flags = NDArray[np.bool_]

TOUCHING_M = 1e-9


class Prisms:
    """Upright boxes, all in one: arrays of [boxes, ...]."""

    def __init__(self, blocks: tuple[Block, ...]) -> None:
        rows = [(b.x_m, b.y_m, b.yaw_rad, b.length_m, b.width_m, b.bottom_m, b.height_m, b.gray) for b in blocks]
        x, y, yaw, length, width, bottom, height, gray = np.array(rows, dtype=np.float64).reshape(-1, 8).T
        self.gray: Indices = gray.astype(np.intp)
        self._corners: Floats = np.array([box_mesh(block)[0] for block in blocks]).reshape(-1, 8, 3)
        cos, sin, nothing, one = np.cos(yaw), np.sin(yaw), np.zeros(len(x)), np.ones(len(x))
        self._middle = np.stack([x, y, nothing], axis=1)
        # To a box's own axes: along, across and up.
        self._turn = np.stack([cos, sin, nothing, -sin, cos, nothing, nothing, nothing, one], axis=1).reshape(-1, 3, 3)
        self._low = np.stack([-length / 2, -width / 2, bottom], axis=1)
        self._high = np.stack([length / 2, width / 2, bottom + height], axis=1)
        self._size_m = np.hypot(length, width) / 2

    def far_to_near(self, chosen: Indices, facing: Flags, eye: Floats) -> Iterable[Indices]:
        """Sort boxes into an order to paint them in: groups of one gray, each over those before it.

        Two boxes that do not overlap have a face of one of them between them: if the eye is beyond it, too, the other
        box is in front. Boxes that overlap, or hide each other in a ring, are taken by their distance.
        """
        gray = self.gray[chosen]
        if not len(chosen) or (gray == gray[0]).all():
            yield chosen
            return
        away_m = np.hypot(*(self._middle[chosen, :2] - eye[:2]).T)
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
        count = len(self.gray)
        flags: Flags = np.empty((count, 6, count), dtype=np.bool_)
        for j, corners in enumerate(self._corners):
            own = self._turn @ (corners.T - self._middle[:, :, None])  # [boxes, axes, corners]
            flags[:, 0::2, j] = np.all(own <= self._low[:, :, None] + TOUCHING_M, axis=2)
            flags[:, 1::2, j] = np.all(own >= self._high[:, :, None] - TOUCHING_M, axis=2)
        return flags

    def ranges_m(self, origin: tuple[float, float, float], angles_rad: Floats, reach_m: float) -> Floats:
        """Distances to the first box along level rays [n] from one point; infinite beyond `reach_m`."""
        place = np.array(origin)
        off = place - self._middle
        near = off[:, 0] * off[:, 0] + off[:, 1] * off[:, 1] <= (reach_m + self._size_m) ** 2
        chosen = np.flatnonzero(near & (self._low[:, 2] <= place[2]) & (place[2] <= self._high[:, 2]))
        if not len(chosen):
            return np.full(len(angles_rad), math.inf)
        directions = np.empty((2, len(angles_rad)))
        np.cos(angles_rad, out=directions[0])
        np.sin(angles_rad, out=directions[1])
        free = self._enter(off[chosen, :2], directions, chosen).min(axis=0)
        return np.where(free <= reach_m, free, math.inf)

    def distances_m(self, eye: Floats, directions: Floats, chosen: Indices) -> Floats:
        """How many times each of the directions [3, n] it is from a point to the first of some boxes: [n]."""
        nearest = np.full(directions.shape[1], math.inf)
        for one in chosen[:, None]:  # one by one: there are many rays
            nearest = np.minimum(nearest, self._enter(eye - self._middle[one], directions, one)[0])
        return nearest

    def _enter(self, off: Floats, directions: Floats, chosen: Indices) -> Floats:
        """How far along rays some boxes are entered, [boxes, n]; infinite where a ray misses one.

        `off` [boxes, axes] is where the rays begin, from each box's middle, and `directions` [axes, n] where they go:
        three axes, or without the third where all are level.
        """
        axes = len(directions)
        turn = self._turn[chosen, :axes, :axes]
        at, way = turn @ off[:, :, None], turn @ directions
        with np.errstate(divide="ignore", invalid="ignore"):  # between two faces that it is parallel to, or not
            one = (self._low[chosen, :axes, None] - at) / way
            other = (self._high[chosen, :axes, None] - at) / way
        enter = np.maximum(np.fmax.reduce(np.fmin(one, other), axis=1), 0.0)
        return np.where(enter <= np.fmin.reduce(np.fmax(one, other), axis=1), enter, math.inf)
