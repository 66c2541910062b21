"""Filled polygons, pixel by pixel as a renderer would: a pixel is covered if its middle is. Pure numpy.

OpenCV's polygons also cover whatever their outline touches, which would make a far line twice as wide as it is.
"""

import numpy as np

from lira.hal.messages import ByteArray
from lira.sim_backend.polyline import Floats

AFTER = {4: [1, 2, 3, 0], 5: [1, 2, 3, 4, 0]}  # each corner's next


def cover(picture: ByteArray, x: Floats, y: Floats, gray: int) -> None:
    """Paint polygons with corners at x and y [n, 4 or 5], in pixels from the upper left corner of the picture.

    They all turn the same way. Every edge notes where it crosses the middle of a row: +1 on the way down, -1 on the way
    up. Summed up pixel after pixel that is how many polygons cover one. Edges that two polygons share cancel out.
    """
    height_px, width_px = picture.shape
    after = AFTER[x.shape[1]]
    # First row whose middle is below each corner, within the picture.
    row = np.ceil(np.minimum(np.maximum(y, 0.0), height_px) - 0.5).astype(np.intp)
    step = row[:, after] - row
    edges = np.flatnonzero(step)
    if not len(edges):
        return
    x0, y0, x1, y1, first = (each.reshape(-1)[edges] for each in (x, y, x[:, after], y[:, after], row))
    step = step.reshape(-1)[edges]
    count = np.abs(step)
    # Whichever way it is walked, an edge crosses a row at the very same place.
    up = step < 0
    x0, y0, x1, y1 = np.where(up, (x1, y1, x0, y0), (x0, y0, x1, y1))
    first = first + np.minimum(step, 0)
    slope = (x1 - x0) / (y1 - y0)
    at_first = x0 + (first + 0.5 - y0) * slope
    edge = np.repeat(np.arange(len(edges)), count)
    below = np.arange(len(edge)) - (np.cumsum(count) - count)[edge]
    column = np.ceil(at_first[edge] + below * slope[edge] - 0.5)
    column = np.minimum(np.maximum(column, 0.0), width_px).astype(np.intp)
    place = (first[edge] + below) * width_px + column
    order = np.argsort(place)
    place, change = place[order], np.sign(step)[edge[order]]
    # Every row ends as it began, with nothing: what crosses beyond its end counts from the beginning of the next.
    covered = np.repeat(np.cumsum(change) != 0, np.diff(place, append=picture.size))
    np.copyto(picture.reshape(-1)[place[0] :], gray, where=covered)
