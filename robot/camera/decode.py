"""Pictures from outside become pixels, or a `SensorError`: nothing is decoded that was not looked over before."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lira.hal.errors import SensorError
from lira.hal.messages.images import objection

CHANNELS = 3
# By how much a picture may be reduced while it is decoded, and how that is asked for: the largest first.
REDUCED = ((8, cv2.IMREAD_REDUCED_COLOR_8), (4, cv2.IMREAD_REDUCED_COLOR_4), (2, cv2.IMREAD_REDUCED_COLOR_2))
OPAQUE = 255


def check(data: bytes, start: bytes = b"") -> None:
    """Raise `SensorError` for a picture that begins otherwise, or is not to be decoded."""
    why = objection(data) if data.startswith(start) else "no JPEG"
    if why:
        raise SensorError(f"a picture of {len(data)} bytes was refused: {why}", "Use JPEGs or PNGs of a moderate size.")


def decode(data: bytes, reduction: int = 1) -> NDArray[np.uint8]:
    """Return the pixels of a JPEG or PNG, [height, width, 3], blue first, upright by its Exif orientation.

    `reduction` is that of `REDUCED`, or 1. Raises `SensorError`, also for a picture that one can see through.
    """
    check(data)
    how = dict(REDUCED).get(reduction, cv2.IMREAD_COLOR)
    pixels = _decode(data, how)
    if data[25:26] in (b"\x04", b"\x06") and not data.startswith(b"\xff"):  # a PNG with alpha
        whole = _decode(data, cv2.IMREAD_UNCHANGED)
        if whole.ndim == 3 and whole.shape[2] == 4 and (whole[..., 3] != OPAQUE).any():
            raise SensorError("one can see through a picture: it has an alpha channel", "Use pictures without one.")
    return colours(pixels)


def colours(pixels: Any) -> NDArray[np.uint8]:
    """Return what OpenCV gave if it is a picture in colour, [height, width, 3]. Raises `SensorError`."""
    if not isinstance(pixels, np.ndarray) or pixels.dtype != np.uint8 or pixels.ndim != 3 or not pixels.size:
        raise SensorError("what came is no picture in colour")
    if pixels.shape[2] != CHANNELS:
        raise SensorError(f"a picture has {pixels.shape[2]} channels")
    return pixels


def _decode(data: bytes, how: int) -> Any:
    try:
        pixels: Any = cv2.imdecode(np.frombuffer(data, np.uint8), how)
    except (cv2.error, MemoryError) as error:
        raise SensorError(f"a picture of {len(data)} bytes cannot be decoded") from error
    if pixels is None:
        raise SensorError(f"a picture of {len(data)} bytes cannot be decoded")
    return pixels
