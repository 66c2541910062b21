"""The robot's newest picture as pixels; decoded once, however often it is drawn."""

from functools import lru_cache

import cv2
import numpy as np

from lira.hal.messages import ByteArray, CompressedImage


def pixels_of(picture: CompressedImage | None) -> ByteArray | None:
    """RGB, uint8 [height, width, 3]; None for no picture, and for what is none."""
    return None if picture is None else _decode(bytes(picture.data))


@lru_cache(maxsize=1)
def _decode(data: bytes) -> ByteArray | None:
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if pixels is None else np.ascontiguousarray(pixels[..., ::-1], np.uint8)
