"""The pictures of an episode, one by one: a run's would not fit into memory all at once."""

from collections.abc import Iterable, Iterator

import cv2
import numpy as np

from lira.hal.messages import ByteArray, CompressedImage, Image
from lira.hal.messages.images import objection
from lira.tools.export.steps import ExportStep

Size = tuple[int, int]  # height, width


def size_of(steps: Iterable[ExportStep]) -> Size | None:
    """Return the size of the first picture that can be looked at; None where there is none at all."""
    first = next(filter(lambda each: each is not None, map(_rgb, steps)), None)
    return None if first is None else (first.shape[0], first.shape[1])


def pictures_of(steps: Iterable[ExportStep], size: Size) -> Iterator[ByteArray]:
    """Yield RGB, uint8 [height, width, 3], for each step; the one before, at first gray, where there is none."""
    shown: ByteArray = np.full((*size, 3), 128, np.uint8)
    for step in steps:
        found = _rgb(step)
        if found is not None:
            shown = found if found.shape[:2] == size else _resized(found, size)
        yield shown


def _resized(picture: ByteArray, size: Size) -> ByteArray:
    return cv2.resize(picture, size[::-1], interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def _rgb(step: ExportStep) -> ByteArray | None:
    """A step's picture; None for one that is absent or cannot be decoded."""
    picture = step.observation.image
    if isinstance(picture, CompressedImage):
        return _decoded(picture.data)
    if isinstance(picture, Image) and picture.encoding in ("rgb8", "mono8"):
        return picture.data if picture.data.ndim == 3 else np.repeat(picture.data[..., None], 3, axis=2)
    return None


def _decoded(data: bytes) -> ByteArray | None:
    if objection(data):
        return None
    try:
        bgr = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if bgr is None else cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)
