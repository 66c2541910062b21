"""A video file, at its own speed and over again: for tests and demonstrations."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np

from lira.hal.errors import DeviceError, SensorError
from lira.hal.messages import Image
from lira.robot.camera.fit import Size, check_shape
from lira.robot.camera.sources.video import FAULTS, words


class FilmSource:
    """Shows a file in `size` (width, height), or one of that shape. Raises `DeviceError`."""

    def __init__(self, path: Path, size: Size) -> None:
        self._path, self._size = path, size
        try:
            self._container = av.open(str(path))
            self._stream = self._container.streams.video[0]
        except (IndexError, *FAULTS) as error:
            raise DeviceError(f"{path} is no video", "Name a file that FFmpeg can play.") from error
        self._frames = self._played()
        self._next: tuple[float, Any] | None = None  # what is due when

    def grab(self, timeout_s: float) -> Image | None:
        """Return the newest picture that is due. Raises `SensorError` for one that cannot be read."""
        try:
            due_s, frame = self._next or next(self._frames)
            wait_s = due_s - time.monotonic()
            if wait_s > timeout_s:
                self._next = due_s, frame
                time.sleep(timeout_s)
                return None
            time.sleep(max(wait_s, 0.0))
            self._next = next(self._frames)
            while self._next[0] <= time.monotonic():  # who looks late sees the newest, as of a camera
                frame, self._next = self._next[1], next(self._frames)
            check_shape((frame.width, frame.height), self._size)
            pixels = frame.reformat(*self._size, format="rgb24").to_ndarray()
        except FAULTS as error:
            raise SensorError(f"a picture of {self._path} cannot be read: {words(error)}") from error
        return Image(time.monotonic(), np.ascontiguousarray(pixels, np.uint8))

    def close(self) -> None:
        """Close the file."""
        self._container.close()

    def _played(self) -> Iterator[tuple[float, Any]]:
        """Every picture with the time at which it is due; after the last comes the first."""
        while True:
            start_s, count = time.monotonic(), 0
            for frame in self._container.decode(self._stream):
                count += 1
                yield start_s + (frame.time or 0.0), frame
            if not count:
                raise ValueError("there is none in it")
            self._container.seek(0)
