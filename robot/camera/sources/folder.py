"""A folder of images, in the order of their names and over again: for tests and demonstrations."""

import os
import stat
import time
from pathlib import Path

import numpy as np

from lira.hal.errors import DeviceError, SensorError
from lira.hal.messages import CompressedImage, Image
from lira.hal.messages.images import JPEG_START
from lira.robot.camera.decode import check, decode
from lira.robot.camera.header import read_header
from lira.robot.camera.port import LARGEST_BYTES, Picture

PERIOD_S = 1 / 15
KINDS = {".jpg", ".jpeg", ".png"}


class FolderSource:
    """Shows the images of a folder at 15 Hz. Raises `DeviceError`."""

    def __init__(self, folder: Path) -> None:
        try:
            self._paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in KINDS and path.is_file())
        except OSError as error:
            raise DeviceError(f"cannot read {folder}: {error.strerror}", "Check the folder.") from error
        if not self._paths:
            raise DeviceError(f"{folder} holds no image", f"Put {', '.join(sorted(KINDS))} files there.")
        self._next = 0
        self._due_s = time.monotonic()

    def grab(self, timeout_s: float) -> Picture | None:
        """Return the next image, when it is due. Raises `SensorError` for a file that is none."""
        wait_s = self._due_s - time.monotonic()
        if wait_s > timeout_s:
            time.sleep(timeout_s)
            return None
        time.sleep(max(wait_s, 0.0))
        self._due_s = max(self._due_s + PERIOD_S, time.monotonic())
        path = self._paths[self._next]
        self._next = (self._next + 1) % len(self._paths)
        return load(path)

    def close(self) -> None:
        """Nothing to let go of."""


def load(path: Path) -> Picture:
    """Read an image, as if it were taken now: a JPEG as it is, anything else as pixels. Raises `SensorError`."""
    stamp_s = time.monotonic()
    try:
        # Without O_NONBLOCK a pipe of that name would hold up the camera until somebody writes to it.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise SensorError(f"{path} is no file", "Take it out of the folder.")
            data = file.read(LARGEST_BYTES + 1)
        if len(data) > LARGEST_BYTES:
            raise SensorError(f"{path} is larger than {LARGEST_BYTES} bytes", "Take it out of the folder.")
        if path.suffix.lower() in {".jpg", ".jpeg"}:
            check(data, JPEG_START)
            return CompressedImage(stamp_s, data)
        check(data)
        read_header(data)
        return Image(stamp_s, np.ascontiguousarray(decode(data)[..., ::-1], np.uint8))
    except OSError as error:
        raise SensorError(f"cannot read {path}: {error.strerror}", "Check the folder.") from error
