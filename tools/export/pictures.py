"""The pictures of a recording, told one by one: a run's would not fit into memory all at once."""

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property

import cv2
import numpy as np

from lira.hal.messages import ByteArray, CompressedImage
from lira.hal.messages.images import objection
from lira.tools.export.steps import ExportStep

Size = tuple[int, int]  # height, width
GRAY = 128


class Pictures:
    """All pictures of a recording. `tell` tells them in order, from the first one, whenever it is asked."""

    def __init__(self, tell: Callable[[], Iterator[CompressedImage]]) -> None:
        self._tell = tell

    @cached_property
    def size(self) -> Size | None:
        """Size of the first that can be looked at; None where there is none at all."""
        first = next((rgb for each in self._tell() if (rgb := _rgb(each)) is not None), None)
        return None if first is None else (first.shape[0], first.shape[1])

    def of(self, steps: Iterable[ExportStep]) -> Iterator[ByteArray]:
        """Yield RGB, uint8 [height, width, 3], for each step, in the order of the recording.

        Where a step has none it is the one before, at first gray. Those of another size are resized.
        """
        size = self.size or (0, 0)
        shown: ByteArray = np.full((*size, 3), GRAY, np.uint8)
        numbered, last = enumerate(self._tell()), -1
        for step in steps:
            if step.picture is not None and step.picture > last:
                last, picture = next(each for each in numbered if each[0] == step.picture)
                found = _rgb(picture)
                shown = shown if found is None else _resized(found, size)
            yield shown


def _resized(picture: ByteArray, size: Size) -> ByteArray:
    if picture.shape[:2] == size:
        return picture
    return cv2.resize(picture, size[::-1], interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def _rgb(picture: CompressedImage) -> ByteArray | None:
    """A picture; None for one that cannot be decoded."""
    if objection(picture.data):
        return None
    try:
        bgr = cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if bgr is None else cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)
