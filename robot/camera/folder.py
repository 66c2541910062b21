"""A folder of images, in the order of their names and over again: for tests and demonstrations."""

import time
from pathlib import Path

import cv2
import numpy as np

from hal.errors import DeviceError
from hal.messages import CompressedImage, Image
from robot.camera.source import Picture

PERIOD_S = 1 / 15
KINDS = {".jpg", ".jpeg", ".png", ".bmp"}


class FolderSource:
    """Shows the images of a folder at 15 Hz. Raises `DeviceError`."""

    def __init__(self, folder: Path) -> None:
        self._paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in KINDS)
        if not self._paths:
            raise DeviceError(f"{folder} holds no image", f"Put {', '.join(sorted(KINDS))} files there.")
        self._next = 0
        self._due_s = time.monotonic()

    def grab(self, timeout_s: float) -> Picture | None:
        """Return the next image, when it is due."""
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
    """Read an image, as if it were taken now: a JPEG as it is, anything else as pixels. Raises `DeviceError`."""
    stamp_s = time.monotonic()
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DeviceError(f"cannot read {path}: {error.strerror}", "Check the folder.") from error
    if path.suffix.lower() in {".jpg", ".jpeg"}:
        return CompressedImage(stamp_s, data)
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:
        raise DeviceError(f"{path} is no image", "Take it out of the folder.")
    return Image(stamp_s, np.ascontiguousarray(pixels[..., ::-1], np.uint8))
