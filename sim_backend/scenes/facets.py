"""All faces of a floor in one table, so that a picture asks once which of them are in view."""

import numpy as np
from numpy.typing import NDArray

from lira.sim_backend.layout import Layout
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.base import FAR_M, NEAR_M, View
from lira.sim_backend.scenes.shapes import Indices, box_mesh, paint, straighten

Flags = NDArray[np.bool_]
REACH_M = np.array([0.0, 0.0, 0.0, 0.0, -NEAR_M, FAR_M])  # of a view's six sides from the eye


class Facets:
    """Flat faces with four corners each: first what is painted on the floor, layer on layer, then the boxes' six each.

    `corners` [n, 4, 3], `gray` [n]; `painted` is how many are paint.
    """

    def __init__(self, layout: Layout) -> None:
        layers = [(gray, straighten(points[faces])) for gray, (points, faces) in paint(layout)]
        boxes = [(block.gray, points[faces]) for block in layout.blocks for points, faces in [box_mesh(block)]]
        pieces = [corners for _, corners in layers + boxes]
        self.corners: Floats = np.concatenate([np.zeros((0, 4, 3)), *pieces])
        self.gray: Indices = np.repeat([gray for gray, _ in layers + boxes], [len(each) for each in pieces]).astype(int)
        self.painted = sum(len(corners) for _, corners in layers)
        centre = self.corners.mean(axis=1)
        self._centre: Floats = np.ascontiguousarray(centre.T)
        self._radius_m: Floats = np.sqrt(((self.corners - centre[:, None]) ** 2).sum(-1).max(-1, initial=0.0))
        outward = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        self._outward: Floats = outward
        self._offset: Floats = (outward * centre).sum(-1)

    def facing(self, eye: Floats) -> Flags:
        """Which of them an eye at [3] sees from outside, [n]."""
        return self._outward @ eye > self._offset

    def in_view(self, view: View, eye: Floats, axes: Floats) -> Flags:
        """Which of them may have a part in a view, [n]: never too few, at times a few too many."""
        bounds = (axes @ view.bounds).T
        reach_m = bounds @ eye + REACH_M
        inside: Flags = np.logical_and.reduce(bounds @ self._centre <= self._radius_m + reach_m[:, None], axis=0)
        return inside


def project(corners: Floats, view: View, eye: Floats, axes: Floats) -> Floats:
    """Where in the picture the corners of faces [n, 4, 3] are: x and y [2, m, 4], in pixels from its upper left corner.

    `axes` are the camera's own as columns. Of faces that come too near the eye the part that does is cut off, which
    leaves none, one or two of them.
    """
    own = (axes.T @ (corners.reshape(-1, 3) - eye).T).reshape(3, -1, 4)
    if own[2].min() < NEAR_M:
        near = (own[2] < NEAR_M).any(axis=1)
        pieces = [piece for face in own[:, near].transpose(1, 2, 0).tolist() for piece in cut(face)]
        own = np.concatenate([own[:, ~near], np.array(pieces).reshape(-1, 4, 3).transpose(2, 0, 1)], axis=1)
    places: Floats = own[:2] / (view.slopes * own[2])
    places += 1.0
    places *= view.middle_px
    return places


def cut(face: list[list[float]]) -> list[list[list[float]]]:
    """Cut a face off where it is too near, and make faces of four corners of what is left."""
    left = []
    for one, other in zip(face, face[1:] + face[:1], strict=True):
        if one[2] >= NEAR_M:
            left.append(one)
        if (one[2] >= NEAR_M) != (other[2] >= NEAR_M):
            share = (NEAR_M - one[2]) / (other[2] - one[2])
            left.append([here + share * (there - here) for here, there in zip(one, other, strict=True)])
    if len(left) < 3:
        return []
    rest = [[left[0], left[3], left[4], left[4]]] if len(left) == 5 else []
    return [[*left[:3], left[3] if len(left) > 3 else left[2]], *rest]
