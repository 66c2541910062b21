"""From raw sensor messages to what the networks see: `bins` ranges and a small gray image, both in [0, 1]."""

import math
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from lira.hal.errors import SensorError
from lira.hal.messages import ByteArray, CompressedImage, FloatArray, Image, LaserScan, Observation
from lira.hal.messages.ranges import read_ranges
from lira.hal.profile import Features as FeatureShape
from lira.hal.profile import RobotProfile

# Beam angles arrive as float32, so a beam that lies on the edge between two bins is off by less than this.
EDGE_BINS = 1e-3
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


class ReadingError(SensorError):
    """A reading that cannot be used; `reason` is the short name it is counted under."""

    def __init__(self, reason: str, what: str, remedy: str) -> None:
        super().__init__(what, remedy)
        self.reason = reason


@dataclass(frozen=True, slots=True)
class Features:
    """What the networks see. `scan`: float32 [bins], `image`: float32 [px, px], both in [0, 1]."""

    scan: FloatArray
    image: FloatArray


class Preprocessor:
    """Turns observations into features and counts what it had to leave out.

    `invalid_beams` counts beams that read nan, `refused` the readings that could not be used, by reason.
    """

    def __init__(self, profile: RobotProfile) -> None:
        self._shape = profile.features
        self.invalid_beams = 0
        self.refused: Counter[str] = Counter()

    def __call__(self, observation: Observation) -> Features | None:
        """Return the features, or None while a sensor is absent or stale. Raises `SensorError` after counting it."""
        if observation.scan is None or observation.image is None:
            return None
        try:
            scan, invalid = bin_scan(observation.scan, self._shape)
            image = gray_image(observation.image, self._shape.image_px)
            _check_light(image)
        except ReadingError as error:
            self.refused[error.reason] += 1
            raise
        self.invalid_beams += invalid
        return Features(scan, image)


def bin_scan(scan: LaserScan, shape: FeatureShape) -> tuple[FloatArray, int]:
    """Crop a scan to the field of view ahead, bin it and normalise it.

    Returns float32 [bins] (counter-clockwise, the nearest return of each bin over `max_range_m`; 1.0: no return,
    0.0: too close) and the number of invalid beams. A bin without a valid beam takes its nearest neighbour's value.
    Which beams are valid, too close or without a return is as `hal.ranges` has it.
    Raises `SensorError` for a scan that does not cover the field of view or that is invalid in most of it.
    """
    if np.ndim(scan.ranges) != 1:
        raise ReadingError(
            "scan shape", f"the scan has {np.ndim(scan.ranges)} dimensions instead of 1", "Check the lidar driver."
        )
    layout = _layout(len(scan.ranges), scan.angle_min, scan.angle_increment, shape.fov_rad, shape.bins)
    beams = read_ranges(scan, layout.beams)
    invalid = int(np.count_nonzero(np.isnan(beams)))
    nearest = np.full(shape.bins, np.nan, dtype=np.float32)
    nearest[layout.bins] = np.fmin.reduceat(beams, layout.starts)
    if invalid or layout.bins.size < shape.bins:
        nearest = _fill(nearest)
    return np.clip(nearest / np.float32(shape.max_range_m), 0.0, 1.0), invalid


@dataclass(frozen=True, slots=True)
class _Layout:
    """Which beams fall into which bins: `beams` sorted by bin, `starts` of each group in it, `bins` of the groups."""

    beams: NDArray[np.intp]
    starts: NDArray[np.intp]
    bins: NDArray[np.intp]


@lru_cache(maxsize=16)
def _layout(count: int, angle_min: float, increment: float, fov_rad: float, bins: int) -> _Layout:
    """Sort the beams of a scan into bins. Raises `SensorError` where they do not cover the field of view."""
    remedy = "Compare the lidar's settings with the [lidar] and [features] tables of the robot's profile."
    turn = 2 * math.pi
    if not (abs(angle_min) <= 2 * turn and 0.0 < abs(increment) <= turn):  # nan is neither
        what = f"the scan's angles make no sense: angle_min {angle_min}, angle_increment {increment}"
        raise ReadingError("scan angles", what, remedy)
    step = abs(increment)
    if count < 2 or count * step > turn + 1.5 * step:
        what = f"a scan of {count} beams every {math.degrees(step):.3g} deg has the wrong length"
        raise ReadingError("scan length", what, remedy)
    width = fov_rad / bins
    if not _covers(count, angle_min, increment, fov_rad, max(width, step) / 2):
        what = (
            f"the scan has the wrong length: {count} beams from {math.degrees(angle_min):.1f} deg every "
            f"{math.degrees(increment):.3g} deg do not cover the {math.degrees(fov_rad):.0f} deg ahead"
        )
        raise ReadingError("scan length", what, remedy)
    angles = np.remainder(angle_min + increment * np.arange(count) + math.pi, turn) - math.pi
    position = (angles + fov_rad / 2) / width
    inside = np.flatnonzero((position >= -EDGE_BINS) & (position <= bins + EDGE_BINS))
    index = np.clip(np.floor(position[inside] + EDGE_BINS), 0, bins - 1).astype(np.intp)
    order = np.argsort(index, kind="stable")
    groups, starts = np.unique(index[order], return_index=True)
    return _Layout(inside[order], starts, groups)


def _covers(count: int, angle_min: float, increment: float, fov_rad: float, slack_rad: float) -> bool:
    """Whether beams reach both ends of the field of view ahead, whatever turn their angles are counted in."""
    if (count + 0.5) * abs(increment) >= 2 * math.pi:
        return True
    low, high = sorted((angle_min, angle_min + increment * (count - 1)))
    middle = (low + high) / 2
    turn = 2 * math.pi * round(middle / (2 * math.pi))
    return low - turn <= -fov_rad / 2 + slack_rad + 1e-4 and high - turn >= fov_rad / 2 - slack_rad - 1e-4


def _fill(values: FloatArray) -> FloatArray:
    """Give every nan the value of the nearest bin that has one; of two equally near, the smaller range."""
    known = np.flatnonzero(~np.isnan(values))
    if 2 * known.size < values.size:
        what = f"{values.size - known.size} of {values.size} bins of the scan have no valid beam"
        raise ReadingError("scan invalid", what, "Clean the lidar, and check that it turns and what is in its way.")
    if known.size == values.size:
        return values
    bins = np.arange(values.size)
    after = np.searchsorted(known, bins).clip(max=known.size - 1)
    before = (np.searchsorted(known, bins, side="right") - 1).clip(min=0)
    to_left, to_right = np.abs(bins - known[before]), np.abs(known[after] - bins)
    left, right = values[known[before]], values[known[after]]
    filled: FloatArray = np.where(to_left < to_right, left, right)
    return np.where(to_left == to_right, np.minimum(left, right), filled)


def gray_image(image: Image | CompressedImage, px: int) -> FloatArray:
    """Turn a camera image into float32 [px, px] in [0, 1]: gray after BT.601, averaged down over areas.

    Raises `SensorError` for data that is truncated, broken or not what its format says.
    """
    gray = _decode(image, px) if isinstance(image, CompressedImage) else _raw_gray(image)
    if gray.shape != (px, px):
        gray = cv2.resize(gray, (px, px), interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
    return from_uint8(gray)


def _check_light(image: FloatArray) -> None:
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
