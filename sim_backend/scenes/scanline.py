"""Filled polygons, pixel by pixel as a renderer would: a pixel is covered if its middle is. Pure numpy.

OpenCV's polygons also cover whatever their outline touches, which would make a far line twice as wide as it is.
"""

import numpy as np

from lira.hal.messages import ByteArray
from lira.sim_backend.polyline import Floats

AFTER = np.array([1, 2, 3, 0])  # each corner's next


def cover(picture: ByteArray, places: Floats, gray: int) -> None:
    """Paint faces with corners at x and y [2, n, 4], in pixels from the upper left corner of the picture.

    They all turn the same way. Every edge notes where it crosses the middle of a row: +1 on the way down, -1 on the way
    up. Summed up pixel after pixel that is how many faces cover one. Edges that two faces share cancel out.
    """
    height_px, width_px = picture.shape
    # First row whose middle is below each corner, within the picture.
    row = np.ceil(np.minimum(np.maximum(places[1], 0.0), height_px) - 0.5).astype(np.intp)
    rows = (row.take(AFTER, 1) - row).reshape(-1)
    (edges,) = rows.nonzero()
    if not len(edges):
        return
    rows, row = rows[edges], row.reshape(-1)[edges]
    begin = places.reshape(2, -1).take(edges, 1)
    end = places.take(AFTER, 2).reshape(2, -1).take(edges, 1)
    # Whichever way it is walked, an edge crosses a row at the very same place.
    down = rows > 0
    (x0, y0), (x1, y1) = np.where(down, begin, end), np.where(down, end, begin)
    first, count = np.where(down, row, row + rows), np.abs(rows)
    slope = (x1 - x0) / (y1 - y0)
    at_first = x0 + (first + 0.5 - y0) * slope
    edge = np.repeat(np.arange(len(edges)), count)
    below = np.arange(len(edge)) - (np.cumsum(count) - count)[edge]
    column = np.minimum(np.maximum(np.ceil(at_first[edge] + below * slope[edge] - 0.5), 0.0), width_px)
    place = (first[edge] + below) * width_px + column.astype(np.intp)
    order = place.argsort()
    place, change = place[order], np.where(down, 1, -1)[edge[order]]
    # Every row ends as it began, with nothing: what crosses beyond its end counts from the beginning of the next.
    until = np.append(place[1:], picture.size)
    covered = np.repeat(change.cumsum() != 0, until - place)
    np.copyto(picture.reshape(-1)[place[0] :], gray, where=covered)
