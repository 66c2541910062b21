"""The pictures of a recording, told one by one: a run's would not fit into memory all at once."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property

import cv2
import numpy as np

from lira.fusion.modalities.depth import near_depth
from lira.fusion.modalities.image import to_uint8
from lira.hal.errors import SensorError
from lira.hal.messages import ByteArray, CompressedImage
from lira.hal.messages.images import objection
from lira.hal.profile import RobotProfile
from lira.tools.export.steps import ExportStep

Size = tuple[int, int]  # height, width
GRAY = 128


class Pictures:
    """All pictures of one camera of a recording. `tell` tells them in order, from the first one, whenever it is asked.

    `number` says which of them belongs to a step, `read` makes RGB of one: uint8 [height, width, 3], None if it cannot.
    """

    def __init__(
        self,
        tell: Callable[[], Iterator[CompressedImage]],
        number: Callable[[ExportStep], int | None],
        read: Callable[[CompressedImage], ByteArray | None],
    ) -> None:
        self._tell, self._number, self._read = tell, number, read

    @cached_property
    def size(self) -> Size | None:
        """Size of the first that can be looked at; None where there is none at all."""
        first = next((rgb for each in self._tell() if (rgb := self._read(each)) is not None), None)
        return None if first is None else (first.shape[0], first.shape[1])

    def of(self, steps: Iterable[ExportStep]) -> Iterator[ByteArray]:
        """Yield one for each step, in the order of the recording.

        Where a step has none it is the one before, at first gray. Those of another size are resized.
        """
        size = self.size or (0, 0)
        shown: ByteArray = np.full((*size, 3), GRAY, np.uint8)
        numbered, last = enumerate(self._tell()), -1
        for step in steps:
            number = self._number(step)
            if number is not None and number > last:
                last, picture = next(each for each in numbered if each[0] == number)
                found = self._read(picture)
                shown = shown if found is None else _resized(found, size)
            yield shown


Cameras = Mapping[str, Pictures]  # by name: camera, depth


def color_pictures(tell: Callable[[], Iterator[CompressedImage]]) -> Pictures:
    """The camera's."""
    return Pictures(tell, lambda step: step.picture, _rgb)


def depth_pictures(tell: Callable[[], Iterator[CompressedImage]], profile: RobotProfile) -> Pictures:
    """The depth camera's, as networks see them: near is dark, and what is beyond their range is white."""
    shape = profile.features

    def read(picture: CompressedImage) -> ByteArray | None:
        try:
            near = near_depth(picture, shape.image_px, shape.max_depth_m or shape.max_range_m)
        except SensorError:
            return None
        return np.repeat(to_uint8(near)[..., None], 3, axis=2)

    return Pictures(tell, lambda step: step.depth, read)


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
