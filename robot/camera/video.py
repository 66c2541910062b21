"""A UVC camera or an RTSP stream through OpenCV."""

import time

import cv2
import numpy as np

from hal.errors import DeviceError
from hal.messages import Image

OPEN_MS, READ_MS = 5000, 1000


class VideoSource:
    """What OpenCV opens at `url`. Raises `DeviceError`."""

    def __init__(self, url: str, size: tuple[int, int]) -> None:
        self._url = url
        if url.startswith("/dev/"):
            self._capture = cv2.VideoCapture(url, cv2.CAP_V4L2)
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, size[0])
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size[1])
            self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        else:
            limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, OPEN_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, READ_MS]
            self._capture = cv2.VideoCapture(url, cv2.CAP_FFMPEG, limits)
        if not self._capture.isOpened():
            raise DeviceError(f"no camera opens at {url}", "Check the address or path, and that nothing else uses it.")

    def grab(self, timeout_s: float) -> Image | None:  # noqa: ARG002 - OpenCV has a limit of its own
        """Return the next picture, rgb8."""
        if not self._capture.grab():
            raise DeviceError(f"the camera at {self._url} was lost", "Check plug, power and network.")
        stamp_s = time.monotonic()
        done, pixels = self._capture.retrieve()
        if not done:
            return None
        return Image(stamp_s, np.ascontiguousarray(pixels[..., ::-1], np.uint8))

    def close(self) -> None:
        """Let go of the camera."""
        self._capture.release()
