"""Whatever a camera sends leaves in the profile's size, or is refused: the profile says what the camera sees."""

import cv2
import numpy as np
from numpy.typing import NDArray

from lira.hal.errors import SensorError
from lira.hal.messages import Image
from lira.hal.messages.compression import PICTURE_LIMIT_BYTES
from lira.hal.messages.images import JPEG_START
from lira.robot.camera.decode import REDUCED, check, decode
from lira.robot.camera.header import UPRIGHT, Header, read_header
from lira.robot.camera.port import Picture

Size = tuple[int, int]
TOLERANCE = 0.03  # of width to height: encoders round to whole blocks


def fit(picture: Picture, size: Size) -> Picture:
    """Return a picture of `size` (width, height) with what a picture shows: a JPEG that fits already goes as it is.

    Raises `SensorError` for one that cannot be decoded, or has another shape.
    """
    if isinstance(picture, Image):
        pixels = scale(picture.data, size)
        return picture if pixels is picture.data else Image(picture.stamp_s, pixels, picture.encoding)
    check(picture.data, JPEG_START)
    header = read_header(picture.data)
    check_shape(header.size, size)
    if travels(picture.data, header, size):
        decode(picture.data, REDUCED[0][0])  # a peer gets it as it is, so it has to be whole
        return picture
    return Image(picture.stamp_s, pixels_of(picture.data, header, size))


def pixels_of(data: bytes, header: Header, size: Size) -> NDArray[np.uint8]:
    """Return the pixels of a JPEG or PNG, red first, in a size. Raises `SensorError`."""
    wide, high = header.size
    reduction = next((times for times, _ in REDUCED if wide >= times * size[0] and high >= times * size[1]), 1)
    return np.ascontiguousarray(scale(decode(data, reduction), size)[..., ::-1])


def travels(data: bytes, header: Header, size: Size) -> bool:
    """Whether a JPEG can go to every peer as it is."""
    upright = header.orientation == UPRIGHT and header.has_tables
    return upright and header.size == size and len(data) <= PICTURE_LIMIT_BYTES


def check_shape(seen: Size, size: Size) -> None:
    """Raise `SensorError` for a picture whose width and height do not go together as the profile's."""
    if abs(seen[0] * size[1] / (seen[1] * size[0]) - 1.0) > TOLERANCE:
        raise SensorError(
            f"its pictures are {seen[0]} x {seen[1]}, the profile's {size[0]} x {size[1]}: another shape",
            "Set the camera to the profile's shape, or write what it really sees into the profile's [camera].",
        )


def scale(pixels: NDArray[np.uint8], size: Size) -> NDArray[np.uint8]:
    """Return pixels in another size of the same shape; the same array if they have it. Raises `SensorError`."""
    height, width = pixels.shape[:2]
    check_shape((width, height), size)
    if (width, height) == size:
        return pixels
    how = cv2.INTER_AREA if width > size[0] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(pixels, size, interpolation=how), np.uint8)
