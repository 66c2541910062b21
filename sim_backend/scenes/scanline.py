"""Filled polygons in perspective, pixel by pixel as a renderer would: a pixel is covered if its middle is. Pure numpy.

OpenCV's polygons also cover whatever their outline touches, which would make a far line twice as wide as it is.
"""

import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import ByteArray
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.base import FAR_M, NEAR_M
from lira.sim_backend.scenes.meshes import Indices

AFTER = {4: [1, 2, 3, 0], 5: [1, 2, 3, 4, 0]}  # each corner's next


def fill(picture: ByteArray, points: Floats, quads: Indices, gray: int) -> None:
    """Paint quadrilaterals, indices [n, 4] of `points`, in one gray. All face the eye, and so turn the same way.

    `points` [m, 3] are right, up and ahead of the eye, the first two divided by the tangents of half the angles of
    view: what is in view has both between -ahead and ahead.
    """
    corners = in_view(points[quads])
    if len(corners):
        height_px, width_px = picture.shape
        ahead = corners[..., 2]
        x = width_px / 2 * (1.0 + corners[..., 0] / ahead)
        y = height_px / 2 * (1.0 - corners[..., 1] / ahead)
        cover(picture, x, y, gray)


def out_of_view(corners: Floats) -> NDArray[np.bool_]:
    """Which solids or polygons [n, corners, 3] are to one side of the view, behind the eye or too far away: [n]."""
    right, up, ahead = corners[..., 0], corners[..., 1], corners[..., 2]
    missed: NDArray[np.bool_] = np.all(ahead < NEAR_M, axis=1) | np.all(ahead > FAR_M, axis=1)
    for aside in (right, up):
        missed = missed | np.all(aside > ahead, axis=1) | np.all(aside < -ahead, axis=1)
    return missed


def in_view(corners: Floats) -> Floats:
    """Leave out polygons [n, 4, 3] outside the view, and cut off what is too near: [k, 4, 3], or [k, 5, 3] if cut."""
    corners = corners[~out_of_view(corners)]
    near = (corners[..., 2] < NEAR_M).any(1)
    if not near.any():
        return corners
    whole = corners[~near][:, [0, 1, 2, 3, 3]]
    return np.concatenate([whole, [clip(each) for each in corners[near]]])


def clip(corners: Floats) -> Floats:
    """Cut a convex polygon [4, 3] off where it is too near: [5, 3], the last corner repeated where there are fewer."""
    pieces = []
    for one, other in zip(corners, corners[AFTER[4]], strict=True):
        if one[2] >= NEAR_M:
            pieces.append(one)
        if (one[2] >= NEAR_M) != (other[2] >= NEAR_M):
            pieces.append(one + (NEAR_M - one[2]) / (other[2] - one[2]) * (other - one))
    return np.array(pieces + [pieces[-1]] * (5 - len(pieces)))


def cover(picture: ByteArray, x: Floats, y: Floats, gray: int) -> None:
    """Paint polygons with corners at x and y [n, corners], in pixels from the upper left corner of the picture.

    Every edge notes where it crosses the middle of a row: +1 on the way down, -1 on the way up. Summed along the row
    that is how many polygons cover a pixel. Edges that two polygons share cancel out.
    """
    height_px, width_px = picture.shape
    after = AFTER[x.shape[1]]
    x0, y0, x1, y1 = x.ravel(), y.ravel(), x[:, after].ravel(), y[:, after].ravel()
    down = y1 > y0
    # Whichever way it is walked, an edge crosses at the very same place.
    x0, y0, x1, y1 = np.where(down, (x0, y0, x1, y1), (x1, y1, x0, y0))
    first, end = np.clip(np.ceil(np.stack([y0, y1]) - 0.5), 0, height_px).astype(np.intp)
    count = end - first
    crossing = np.flatnonzero(count)
    if not len(crossing):
        return
    count, first = count[crossing], first[crossing]
    begun = np.cumsum(count) - count
    edge = np.repeat(crossing, count)
    row = np.arange(len(edge)) + np.repeat(first - begun, count)
    slope = (x1 - x0)[edge] / (y1 - y0)[edge]
    at = np.ceil(x0[edge] + (row + 0.5 - y0[edge]) * slope - 0.5)
    column = np.clip(at, 0, width_px).astype(np.intp)
    top, low = int(first.min()), int(end.max())
    changes = np.zeros((low - top, width_px + 1), np.int16)
    np.add.at(changes.reshape(-1), (row - top) * (width_px + 1) + column, np.where(down[edge], 1, -1).astype(np.int16))
    np.copyto(picture[top:low], gray, where=changes[:, :-1].cumsum(axis=1, dtype=np.int16) != 0)
