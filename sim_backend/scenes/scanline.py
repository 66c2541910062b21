"""Filled polygons, pixel by pixel as a renderer would: a pixel is covered if its middle is. Pure numpy.

OpenCV's polygons also cover whatever their outline touches, which would make a far line twice as wide as it is.
"""

import numpy as np

from lira.hal.messages import ByteArray
from lira.sim_backend.polyline import Floats

AFTER = np.array([1, 2, 3, 0])  # each corner's next
STEP = AFTER - np.arange(4)  # and how far on it is
CHANGE = np.array([-1, 1])  # of how many faces cover a pixel, where an edge goes up and where it goes down


def cover(picture: ByteArray, places: Floats, gray: int) -> None:
    """Paint faces with corners at x and y [2, n, 4], in pixels from the upper left corner of the picture.

    They all turn the same way. Every edge notes where it crosses the middle of a row: +1 on the way down, -1 on the way
    up. Summed up pixel after pixel that is how many faces cover one. Edges that two faces share cancel out.
    """
    height_px, width_px = picture.shape
    corners = places.reshape(2, -1)
    # First row whose middle is below each corner, within the picture.
    row = np.ceil(np.minimum(np.maximum(corners[1], 0.0), height_px) - 0.5).astype(np.intp)
    rows = row.reshape(-1, 4)
    rows = (rows.take(AFTER, 1) - rows).reshape(-1)
    (begin,) = rows.nonzero()
    if not len(begin):
        return
    rows, end = rows.take(begin), begin + STEP.take(begin % 4)
    # Whichever way it is walked, an edge crosses a row at the very same place.
    down = rows > 0
    upper, lower = np.where(down, begin, end), np.where(down, end, begin)
    (x0, y0), (x1, y1) = corners.take(upper, 1), corners.take(lower, 1)
    first, count = row.take(upper), np.abs(rows)
    slope = (x1 - x0) / (y1 - y0)
    at_first = x0 + (first + 0.5 - y0) * slope
    edge = np.arange(len(begin)).repeat(count)
    below = np.arange(len(edge)) - (count.cumsum() - count).take(edge)
    column = np.ceil(at_first.take(edge) + below * slope.take(edge) - 0.5)
    column = np.minimum(np.maximum(column, 0.0, out=column), width_px, out=column)
    place = (first.take(edge) + below) * width_px + column.astype(np.intp)
    # Sorted by place, with the way in the lowest bit.
    crossing = 2 * place + down.take(edge)
    crossing.sort()
    place, change = crossing >> 1, CHANGE.take(crossing & 1)
    # Every row ends as it began, with nothing: what crosses beyond its end counts from the beginning of the next.
    covered = (change.cumsum()[:-1] != 0).repeat(place[1:] - place[:-1])
    np.copyto(picture.reshape(-1)[place[0] : place[-1]], gray, where=covered)
