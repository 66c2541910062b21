"""Depths as the networks see them: small and square, in [0, 1], each pixel the nearest of its part of the picture."""

import numpy as np
from numpy.typing import NDArray

from lira.fusion.modalities.image import from_uint8
from lira.fusion.modalities.reading import ReadingError
from lira.hal.errors import SensorError
from lira.hal.messages import CompressedImage, DepthImage, FloatArray
from lira.hal.messages.compression import read_depth

LEVELS = 255
Floats = NDArray[np.float64]


def near_depth(depth: DepthImage | CompressedImage, px: int, max_range_m: float) -> FloatArray:
    """Turn a depth image into float32 [px, px] in steps of 1/255: 0.0 is at the lens, 1.0 at `max_range_m` or nothing.

    A pixel is the nearest of what falls into it: averaged, an edge before a far wall would lie where nothing is.
    Raises `SensorError` for data that is truncated, broken or no depth.
    """
    try:
        distances = read_depth(depth).data
    except SensorError as error:
        raise ReadingError("depth broken", error.what, "Check the camera and the link to it.") from error
    if distances.ndim != 2 or distances.dtype != np.uint16 or distances.size == 0:
        what = f"a {distances.dtype} array of shape {distances.shape} is no depth image"
        raise ReadingError("depth shape", what, "Publish distances in millimetres as uint16 [height, width].")
    far_mm = 1000.0 * max_range_m
    share = np.where(distances == 0, 1.0, np.minimum(distances / far_mm, 1.0))
    for axis in (0, 1):
        share = _nearest(share, px, axis)
    return from_uint8(np.rint(share * LEVELS).astype(np.uint8))


def _nearest(values: Floats, count: int, axis: int) -> Floats:
    """Take the least of each of `count` equal parts along an axis; of too few values, the one at each part's middle."""
    size = values.shape[axis]
    if size < count:
        middles = ((np.arange(count) + 0.5) * size / count).astype(np.intp)
        taken: Floats = values.take(middles, axis)
        return taken
    least: Floats = np.minimum.reduceat(values, np.arange(count) * size // count, axis)
    return least
