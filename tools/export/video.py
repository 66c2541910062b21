"""One MP4 of all pictures of a data set, at an even rate: H.264, so that every player has it."""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import numpy as np
from av.video.stream import VideoStream

from lira.hal.messages import ByteArray
from lira.tools.export.pictures import Size

CODEC, PIXELS = "h264", "yuv420p"
ENCODER = "libx264"
# Every second picture can be decoded by itself, so that any of them is found fast; hardly a loss to see.
OPTIONS = {"g": "2", "crf": "18"}


def even(size: Size) -> Size:
    """Return the size that a video has: colours are kept for two by two pixels, so an odd edge is doubled."""
    return size[0] + size[0] % 2, size[1] + size[1] % 2


def write_video(path: Path, pictures: Iterable[ByteArray], size: Size, fps: int) -> None:
    """Write pictures, RGB uint8 [*size, 3] each. Raises `OSError`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    height, width = even(size)
    with av.open(str(path), "w") as file:
        stream = cast(VideoStream, file.add_stream(ENCODER, rate=Fraction(fps), options=OPTIONS))
        stream.width, stream.height, stream.pix_fmt = width, height, PIXELS
        stream.codec_context.thread_count = 1
        for number, picture in enumerate(pictures):
            padded = np.pad(picture, ((0, height - size[0]), (0, width - size[1]), (0, 0)), mode="edge")
            frame = av.VideoFrame.from_ndarray(padded, format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, fps)
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
