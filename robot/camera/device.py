"""The camera in a thread of its own: grabs, holds the profile's size, and says when it is lost."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from lira.hal.errors import DeviceError, SensorError
from lira.hal.messages import DepthImage
from lira.hal.profile import Camera
from lira.robot.camera.address import shown
from lira.robot.camera.fit import fit
from lira.robot.camera.port import Picture, Source
from lira.robot.camera.sources.opening import open_source

GRAB_S = 0.2
FIRST_S = 8.0  # some cameras take their time to begin
SILENCE_S = 1.0


class CameraDevice:
    """Hands each picture of the source at `url` to `put`, and with `depth` each depth. `session` is for a `Supervisor`.

    Every picture has the profile's size. JPEGs that fit go as they are; of pixels the HAL server makes JPEGs in a
    thread of its own, if anybody listens.
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
        heard_s, patience_s = time.monotonic(), FIRST_S
        why: SensorError | None = None
        while not stop.is_set():
            picture = None
            try:
                picture = source.grab(GRAB_S)
                if picture is not None and not isinstance(picture, DepthImage):
                    picture = fit(picture, self._size)
            except SensorError as error:
                picture, why = None, error
                self.unreadable += 1
            now_s = time.monotonic()
            if isinstance(picture, DepthImage):
                self._put(picture)
            elif picture is not None:
                self._put(picture)
                self.pictures += 1
                if patience_s == FIRST_S:
                    begin()
                heard_s, patience_s, why = now_s, SILENCE_S, None
            if now_s - heard_s > patience_s:
                raise self._lost(why)

    def _lost(self, why: SensorError | None) -> DeviceError:
        where = shown(self._url)
        if why is not None:
            what = f"the camera at {where} sends no pictures that can be used: {why.what}"
            return DeviceError(what, why.remedy or "Set it to send JPEGs of a moderate size.")
        return DeviceError(f"the camera at {where} sends no pictures", "Check its power, plug and network.")
