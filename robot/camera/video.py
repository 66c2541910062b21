"""A UVC camera or an RTSP stream through OpenCV."""

import time

import cv2
import numpy as np

from lira.hal.errors import DeviceError
from lira.hal.messages import Image
from lira.robot.camera.decode import colours

OPEN_MS, READ_MS = 5000, 1000


class VideoSource:
    """What OpenCV opens at `url`. Raises `DeviceError`."""

    def __init__(self, url: str, size: tuple[int, int]) -> None:
        self._url = url
        try:
            self._open(url, size)
        except cv2.error as error:
            raise self._lost(error) from error
        if not self._capture.isOpened():
            raise DeviceError(f"no camera opens at {url}", "Check the address or path, and that nothing else uses it.")

    def _open(self, url: str, size: tuple[int, int]) -> None:
        if url.startswith("/dev/"):
            self._capture = cv2.VideoCapture(url, cv2.CAP_V4L2)
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, size[0])
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size[1])
            self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        else:
            limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, OPEN_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, READ_MS]
            self._capture = cv2.VideoCapture(url, cv2.CAP_FFMPEG, limits)

    def grab(self, timeout_s: float) -> Image | None:  # noqa: ARG002 - OpenCV has a limit of its own
        """Return the next picture, rgb8. Raises `SensorError` for one that is in no colours."""
        try:
            if not self._capture.grab():
                raise self._lost("it sends nothing")
            stamp_s = time.monotonic()
            done, pixels = self._capture.retrieve()
        except cv2.error as error:
            raise self._lost(error) from error
        if not done:
            return None
        return Image(stamp_s, np.ascontiguousarray(colours(pixels)[..., ::-1], np.uint8))

    def close(self) -> None:
        """Let go of the camera."""
        self._capture.release()

    def _lost(self, why: object) -> DeviceError:
        words = " ".join(str(why).split())
        return DeviceError(f"the camera at {self._url} was lost: {words}", "Check plug, power and network.")
