"""Pictures from outside become pixels, or a `SensorError`: nothing is decoded that was not looked over before."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lira.hal.errors import SensorError
from lira.hal.messages.images import objection

CHANNELS = 3


def check(data: bytes, start: bytes = b"") -> None:
    """Raise `SensorError` for a picture that begins otherwise, or is not to be decoded."""
    why = objection(data) if data.startswith(start) else "no JPEG"
    if why:
        raise SensorError(f"a picture of {len(data)} bytes was refused: {why}", "Use JPEGs or PNGs of a moderate size.")


def decode(data: bytes) -> NDArray[np.uint8]:
    """Return the pixels of a JPEG or PNG, [height, width, 3], blue first. Raises `SensorError`."""
    check(data)
    try:
        pixels: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except (cv2.error, MemoryError) as error:
        raise SensorError(f"a picture of {len(data)} bytes cannot be decoded") from error
    return colours(pixels)


def colours(pixels: Any) -> NDArray[np.uint8]:
    """Return what OpenCV gave if it is a picture in colour, [height, width, 3]. Raises `SensorError`."""
    if not isinstance(pixels, np.ndarray) or pixels.dtype != np.uint8 or pixels.ndim != 3 or not pixels.size:
        raise SensorError("what came is no picture in colour")
    if pixels.shape[2] != CHANNELS:
        raise SensorError(f"a picture has {pixels.shape[2]} channels")
    return pixels
