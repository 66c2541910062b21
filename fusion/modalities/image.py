"""Pictures as the networks see them: gray, small and square, in [0, 1]."""

import cv2
import numpy as np

from lira.fusion.modalities.reading import ReadingError
from lira.hal.messages import ByteArray, CompressedImage, FloatArray, Image

DARK = 12 / 255  # no pixel brighter than this: a covered lens, a dead sensor, a dark room
MAX_IMAGE_PX = 8192  # a side; a header that claims more is broken, and decoding it would take gigabytes

_UNIT = (np.arange(256) / 255).astype(np.float32)
_REDUCED_GRAY = {
    8: cv2.IMREAD_REDUCED_GRAYSCALE_8,
    4: cv2.IMREAD_REDUCED_GRAYSCALE_4,
    2: cv2.IMREAD_REDUCED_GRAYSCALE_2,
    1: cv2.IMREAD_GRAYSCALE,
}
_JPEG_END = b"\xff\xd9"
_PNG_START = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"


def gray_image(image: Image | CompressedImage, px: int) -> FloatArray:
    """Turn a camera image into float32 [px, px] in [0, 1]: gray after BT.601, averaged down over areas.

    Raises `SensorError` for data that is truncated, broken or not what its format says.
    """
    gray = _decode(image, px) if isinstance(image, CompressedImage) else _raw_gray(image)
    if gray.shape != (px, px):
        gray = cv2.resize(gray, (px, px), interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
    return from_uint8(gray)


def check_light(image: FloatArray) -> None:
    """Raises `SensorError` for a picture in which nothing can be seen."""
    if float(image.max()) <= DARK:
        raise ReadingError("image black", "the camera's image is black", "Uncover the lens, and switch on the light.")


def to_uint8(image: FloatArray) -> ByteArray:
    """Turn an image in [0, 1] back into the gray levels it came from, exactly."""
    return np.rint(image * 255).astype(np.uint8)


def from_uint8(gray: ByteArray) -> FloatArray:
    """Scale gray levels to [0, 1]."""
    image: FloatArray = _UNIT[gray]
    return image


def _raw_gray(image: Image) -> ByteArray:
    data = image.data
    channels = {"rgb8": 3, "mono8": 1}.get(image.encoding)
    shaped = data.ndim == 2 if channels == 1 else data.ndim == 3 and data.shape[2] == channels
    if not shaped or data.dtype != np.uint8 or data.size == 0:
        what = f"a {data.dtype} image of shape {data.shape} is not '{image.encoding}'"
        raise ReadingError("image shape", what, "Publish rgb8 or mono8 images.")
    return data if channels == 1 else cv2.cvtColor(data, cv2.COLOR_RGB2GRAY).astype(np.uint8, copy=False)


def _decode(image: CompressedImage, px: int) -> ByteArray:
    """Decode to gray, a JPEG straight to the smallest size that has twice `px` pixels a side.

    With fewer, the decoder's blocks are too coarse for the areas averaged afterwards.
    """
    data = image.data
    if data[:2] == b"\xff\xd8":
        size, whole, reduce = _jpeg_size(data), data.rstrip(b"\0").endswith(_JPEG_END), True
    elif data[:8] == _PNG_START:
        size, whole, reduce = _png_size(data), data.endswith(_PNG_END), False
    else:
        what = f"{len(data)} bytes that are neither a JPEG nor a PNG"
        raise ReadingError("image format", what, "Publish jpeg or png images.")
    if not whole:
        what = f"a truncated {image.format} image of {len(data)} bytes"
        raise ReadingError("image truncated", what, "Check the link to the camera; a later image may be whole.")
    if size is None or not 0 < min(size) <= max(size) <= MAX_IMAGE_PX:
        raise _broken(image)
    scale = next(k for k in _REDUCED_GRAY if k == 1 or (reduce and min(size) // k >= 2 * px))
    try:
        gray = cv2.imdecode(np.frombuffer(data, np.uint8), _REDUCED_GRAY[scale])
    except cv2.error as error:
        raise _broken(image) from error
    if gray is None:
        raise _broken(image)
    return gray.astype(np.uint8, copy=False)


def _broken(image: CompressedImage) -> ReadingError:
    what = f"a {image.format} image of {len(image.data)} bytes that does not decode"
    return ReadingError("image broken", what, "Check the camera and the link to it; a later image may be whole.")


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Height and width from the frame header (ITU T.81, B.2.2), None where there is none."""
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            return int.from_bytes(data[at + 5 : at + 7]), int.from_bytes(data[at + 7 : at + 9])
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4])
    return None


def _png_size(data: bytes) -> tuple[int, int] | None:
    """Height and width from IHDR, which has to come first."""
    if data[12:16] != b"IHDR" or len(data) < 24:
        return None
    return int.from_bytes(data[20:24]), int.from_bytes(data[16:20])
