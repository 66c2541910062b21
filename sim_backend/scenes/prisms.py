"""The boxes of a layout as arrays: which is in front of which, and where rays meet them."""

import math
from collections.abc import Iterable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lira.sim_backend.layout import Block
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.meshes import Indices, box_mesh

Flags = NDArray[np.bool_]

TOUCHING_M = 1e-9


class Prisms:
    """Upright boxes, all in one: arrays of [boxes, ...]."""

    def __init__(self, blocks: tuple[Block, ...]) -> None:
        rows = [(b.x_m, b.y_m, b.yaw_rad, b.length_m, b.width_m, b.bottom_m, b.height_m, b.gray) for b in blocks]
        x, y, yaw, length, width, bottom, height, gray = np.array(rows, dtype=np.float64).reshape(-1, 8).T
        self.gray: Indices = gray.astype(np.intp)
        self._corners: Floats = np.array([box_mesh(block)[0] for block in blocks]).reshape(-1, 8, 3)
        self._x, self._y, self._yaw = x, y, yaw
        self._cos, self._sin = np.cos(yaw), np.sin(yaw)
        self._low = np.stack([-length / 2, -width / 2, bottom], axis=1)
        self._high = np.stack([length / 2, width / 2, bottom + height], axis=1)
        self._bottom, self._top = bottom, bottom + height
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
        everyone = np.arange(len(self.gray))
        flags: Flags = np.empty((len(everyone), 6, len(everyone)), dtype=np.bool_)
        for j, corners in enumerate(self._corners):
            own = np.stack([self._to_own(corner, everyone) for corner in corners])  # [corners, boxes, axes]
            flags[:, 0::2, j] = np.all(own <= self._low + TOUCHING_M, axis=0)
            flags[:, 1::2, j] = np.all(own >= self._high - TOUCHING_M, axis=0)
        return flags

    def ranges_m(self, origin: tuple[float, float, float], angles_rad: Floats, reach_m: float) -> Floats:
        """Distances to the first box along level rays [n] from one point; infinite beyond `reach_m`."""
        off_x, off_y = self._x - origin[0], self._y - origin[1]
        met = (off_x * off_x + off_y * off_y <= (reach_m + self._size_m) ** 2) & (self._bottom <= origin[2])
        chosen = np.flatnonzero(met & (origin[2] <= self._top))
        if not len(chosen):
            return np.full(len(angles_rad), math.inf)
        own = angles_rad - self._yaw[chosen, None]
        free = self._enter(np.array(origin), np.stack([np.cos(own), np.sin(own)], axis=1), chosen).min(axis=0)
        return np.where(free <= reach_m, free, math.inf)

    def distances_m(self, eye: Floats, directions: Floats, chosen: Indices) -> Floats:
        """How many times each of the directions [3, n] it is from a point to the first of some boxes: [n]."""
        nearest = np.full(directions.shape[1], math.inf)
        for i in chosen:  # one by one: there are many rays
            cos, sin = self._cos[i], self._sin[i]
            turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
            nearest = np.minimum(nearest, self._enter(eye, (turn @ directions)[None], np.array([i]))[0])
        return nearest

    def _enter(self, origin: Floats, own: Floats, chosen: Indices) -> Floats:
        """How far along rays some boxes are entered, [boxes, n]; infinite where a ray misses one.

        `own` [boxes, axes, n] are the directions along, across and, unless all are level, up each box.
        """
        low, high = self._low[chosen, : own.shape[1], None], self._high[chosen, : own.shape[1], None]
        at = self._to_own(origin, chosen)[:, : own.shape[1], None]
        with np.errstate(divide="ignore", invalid="ignore"):  # between two faces that it is parallel to, or not
            one, other = (low - at) / own, (high - at) / own
        enter = np.maximum(np.fmax.reduce(np.fmin(one, other), axis=1), 0.0)
        return np.where(enter <= np.fmin.reduce(np.fmax(one, other), axis=1), enter, math.inf)

    def _to_own(self, place: Floats, chosen: Indices) -> Floats:
        """A place [3] along, across and above some boxes, from the middle of where they stand: [boxes, 3]."""
        off_x, off_y = place[0] - self._x[chosen], place[1] - self._y[chosen]
        cos, sin = self._cos[chosen], self._sin[chosen]
        return np.stack([cos * off_x + sin * off_y, cos * off_y - sin * off_x, np.full(len(chosen), place[2])], axis=1)
