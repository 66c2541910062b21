"""The camera in a thread of its own: grabs, keeps what is sent small, and says when it is lost."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from lira.hal.errors import DeviceError, SensorError
from lira.hal.messages import CompressedImage, DepthImage
from lira.hal.messages.compression import PICTURE_LIMIT_BYTES, fit_jpeg
from lira.hal.messages.images import JPEG_START
from lira.hal.profile import Camera
from lira.robot.camera.decode import check, decode
from lira.robot.camera.port import Picture, Source
from lira.robot.camera.source import open_source

GRAB_S = 0.2
FIRST_S = 5.0  # some cameras take their time to begin
SILENCE_S = 1.0


class CameraDevice:
    """Hands each picture of the source at `url` to `put`, and with `depth` each depth. `session` is for a `Supervisor`.

    Pixels are handed on as they are: the HAL server makes JPEGs of them in a thread of its own, if anybody listens.
    """

    def __init__(
        self,
        url: str,
        camera: Camera,
        put: Callable[[Picture | DepthImage], None],
        openni_folder: Path | None,
        *,
        depth: bool = False,
    ) -> None:
        self._url = url
        self._size = (camera.width_px, camera.height_px)
        self._put = put
        self._folder = openni_folder
        self._depth = depth
        self.pictures = self.unreadable = 0

    def session(self, stop: threading.Event, begin: Callable[[], None]) -> None:
        """Open, grab until `stop` is set or the camera is lost, and let go. Raises `DeviceError`."""
        source = open_source(self._url, self._size, self._folder, depth=self._depth)
        try:
            self._grab(source, stop, begin)
        finally:
            source.close()

    def _grab(self, source: Source, stop: threading.Event, begin: Callable[[], None]) -> None:
        """Hand pictures on. One that cannot be read is lost; a camera that sends no others for a while is, too."""
        heard_s, patience_s, why = time.monotonic(), FIRST_S, ""
        while not stop.is_set():
            picture = None
            try:
                picture = source.grab(GRAB_S)
                if isinstance(picture, CompressedImage):
                    picture = shrink(picture)
            except SensorError as error:
                picture, why = None, error.what
                self.unreadable += 1
            now_s = time.monotonic()
            if isinstance(picture, DepthImage):
                self._put(picture)
            elif picture is not None:
                self._put(picture)
                self.pictures += 1
                if patience_s == FIRST_S:
                    begin()
                heard_s, patience_s = now_s, SILENCE_S
            if now_s - heard_s > patience_s:
                raise self._lost(why)

    def _lost(self, why: str) -> DeviceError:
        if why:
            what = f"the camera at {self._url} sends no pictures that can be read: {why}"
            return DeviceError(what, "Set it to send JPEGs of a moderate size.")
        return DeviceError(f"the camera at {self._url} sends no pictures", "Check its power, plug and network.")


def shrink(picture: CompressedImage) -> CompressedImage:
    """Encode a JPEG that is too large to travel again, at the best quality that fits.

    Raises `SensorError` for what is no JPEG that may be decoded.
    """
    check(picture.data, JPEG_START)
    if len(picture.data) <= PICTURE_LIMIT_BYTES:
        return picture
    return CompressedImage(picture.stamp_s, fit_jpeg(decode(picture.data)))
