"""All faces of a floor in one table, so that a picture asks once which of them are in view."""

import numpy as np
from numpy.typing import NDArray

from lira.sim_backend.layout import Layout
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.base import FAR_M, NEAR_M, Pose, View
from lira.sim_backend.scenes.meshes import Indices, box_mesh, paint

Flags = NDArray[np.bool_]


class Facets:
    """Flat faces with four corners each: first what is painted on the floor, layer on layer, then the boxes' six each.

    `corners` [n, 4, 3], `gray` [n]; `painted` is how many are paint.
    """

    def __init__(self, layout: Layout) -> None:
        layers = [(gray, points[faces]) for gray, (points, faces) in paint(layout)]
        boxes = [(block.gray, points[faces]) for block in layout.blocks for points, faces in [box_mesh(block)]]
        pieces = [corners for _, corners in layers + boxes]
        self.corners: Floats = np.concatenate([np.zeros((0, 4, 3)), *pieces])
        self.gray: Indices = np.repeat([gray for gray, _ in layers + boxes], [len(each) for each in pieces]).astype(int)
        self.painted = sum(len(corners) for _, corners in layers)
        self._centre: Floats = self.corners.mean(axis=1)
        self._radius_m: Floats = np.sqrt(((self.corners - self._centre[:, None]) ** 2).sum(-1).max(-1, initial=0.0))
        outward = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        self._outward: Floats = outward
        self._offset: Floats = (outward * self._centre).sum(-1)

    def facing(self, eye: Floats) -> Flags:
        """Which of them an eye at [3] sees from outside, [n]."""
        return self._outward @ eye > self._offset

    def in_view(self, view: View, pose: Pose, eye: Floats) -> Flags:
        """Which of them may have a part in a view, [n]: never too few, at times a few too many."""
        wide, high = view.tangents
        right, up, ahead = view.axes(pose).T
        outward = np.stack([right - wide * ahead, -right - wide * ahead, up - high * ahead, -up - high * ahead], axis=1)
        outward /= np.sqrt((outward**2).sum(0))
        planes = np.concatenate([outward, -ahead[:, None], ahead[:, None]], axis=1)
        beyond_m = self._centre @ planes - (eye @ planes + (0.0, 0.0, 0.0, 0.0, -NEAR_M, FAR_M))
        inside: Flags = np.all(beyond_m <= self._radius_m[:, None], axis=1)
        return inside


def project(corners: Floats, view: View, pose: Pose, eye: Floats) -> tuple[Floats, Floats]:
    """Where in the picture the corners of faces [n, 4, 3] are: x and y [n, 4], in pixels from its upper left corner.

    Of faces that come too near the eye the part that does is cut off: then there are five corners of each.
    """
    wide, high = view.tangents
    own = (corners - eye) @ view.axes(pose)
    near = np.any(own[..., 2] < NEAR_M, axis=1)
    if near.any():
        cut = [clip(each) for each in own[near] if each[:, 2].max() > NEAR_M]
        own = np.concatenate([own[~near][:, [0, 1, 2, 3, 3]], np.array(cut).reshape(-1, 5, 3)])
    ahead = own[..., 2]
    x: Floats = view.width_px / 2 * (1.0 + own[..., 0] / (wide * ahead))
    y: Floats = view.height_px / 2 * (1.0 - own[..., 1] / (high * ahead))
    return x, y


def clip(corners: Floats) -> Floats:
    """Cut a face [4, 3] off where it is too near: [5, 3], the last corner repeated if there are fewer."""
    pieces = []
    for one, other in zip(corners, corners[[1, 2, 3, 0]], strict=True):
        if one[2] >= NEAR_M:
            pieces.append(one)
        if (one[2] >= NEAR_M) != (other[2] >= NEAR_M):
            pieces.append(one + (NEAR_M - one[2]) / (other[2] - one[2]) * (other - one))
    return np.array(pieces + [pieces[-1]] * (5 - len(pieces)))
