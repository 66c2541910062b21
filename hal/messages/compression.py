"""Pictures as they travel: compressed until they fit on the link. And depths, read back from that."""

from typing import Any

import cv2
import numpy as np

from lira.hal.errors import SensorError
from lira.hal.messages import CompressedImage, DepthImage, Image
from lira.hal.messages.images import objection

# Over it, a picture holds up its publisher for 50 ms on a slow link before it is dropped.
PICTURE_LIMIT_BYTES = 64_000
JPEG_QUALITIES = (90, 75, 60, 45, 30, 15, 5)
DEPTH_STEPS = (1, 2, 4)  # every so many pixels of every so many rows
QUICK_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1)


def compress(image: Image, encoding: str) -> CompressedImage:
    """Compress to "png", or to "jpeg" at the best quality that fits the limit. Raises `SensorError`."""
    pixels = image.data[..., ::-1] if image.encoding == "rgb8" else image.data
    if encoding == "png":
        return CompressedImage(image.stamp_s, _encode(".png", pixels, QUICK_PNG), "png")
    return CompressedImage(image.stamp_s, fit_jpeg(pixels), "jpeg")


def fit_jpeg(pixels: Any) -> bytes:
    """Return a JPEG of pixels (uint8, gray or blue first) at the best quality that fits. Raises `SensorError`."""
    data = b""
    for quality in JPEG_QUALITIES:
        data = _encode(".jpg", pixels, (cv2.IMWRITE_JPEG_QUALITY, quality))
        if len(data) <= PICTURE_LIMIT_BYTES:
            break
    return data


def compress_depth(depth: DepthImage) -> CompressedImage:
    """Compress to a PNG of 16 bits that fits the limit. Pixels are left out, never mixed: 0 is no distance.

    Raises `SensorError`.
    """
    data = b""
    for step in DEPTH_STEPS:
        data = _encode(".png", depth.data[::step, ::step], QUICK_PNG)
        if len(data) <= PICTURE_LIMIT_BYTES:
            break
    return CompressedImage(depth.stamp_s, data, "png")


def read_depth(depth: DepthImage | CompressedImage) -> DepthImage:
    """Return the distances of a depth that may have travelled. Raises `SensorError` for a picture that holds none."""
    if isinstance(depth, DepthImage):
        return depth
    pixels: Any = None
    if not objection(depth.data):
        try:
            pixels = cv2.imdecode(np.frombuffer(depth.data, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error as error:
            raise SensorError(f"a depth of {len(depth.data)} bytes cannot be decoded") from error
    if pixels is None or pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise SensorError(f"{len(depth.data)} bytes are no depth", "It travels as a PNG of 16 bits, one channel.")
    return DepthImage(depth.stamp_s, pixels)


def _encode(extension: str, pixels: Any, options: tuple[int, ...]) -> bytes:
    try:
        done, data = cv2.imencode(extension, np.ascontiguousarray(pixels), options)
    except cv2.error as error:
        raise SensorError(f"an image of shape {pixels.shape} does not compress: {error}") from error
    if not done:
        raise SensorError(f"an image of shape {pixels.shape} does not compress")
    return data.tobytes()
