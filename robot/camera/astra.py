"""The Orbbec Astra's colour camera through OpenNI2."""

import contextlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from openni import openni2
from openni.utils import ClosedHandle, InitializationError, OpenNIError

from hal.errors import DeviceError
from hal.messages import Image

# A driver's own thread may still be at its last picture when the stream has stopped; to close it then crashes.
SETTLE_S = 0.15
INSTALL = (
    "Give the folder of Orbbec's OpenNI2 (with libOpenNI2.so and OpenNI2/Drivers in it) by --openni or OPENNI2_REDIST."
)
PLUG = "Is the Astra plugged in, and do Orbbec's udev rules let this user open it? See robot/README.md."


class Device(openni2.Device):  # type: ignore[misc]
    """A device that may fail to open: the package would close what was never opened, and crash."""

    def _reopen(self) -> None:
        try:
            super()._reopen()
        except OpenNIError:
            self._handle = ClosedHandle
            raise


class OpenniSource:
    """Colour of the OpenNI2 device `uri`, or of the first there is if that is empty. Raises `DeviceError`."""

    def __init__(self, uri: str, size: tuple[int, int], folder: Path | None) -> None:
        self._device: Any = None
        self._stream: Any = None
        load(folder)
        try:
            self._device = Device(uri.encode() or None)
            self._stream = self._device.create_color_stream()
            if self._stream is None:
                raise DeviceError(f"the OpenNI2 device {name_of(self._device)} has no colour", PLUG)
            modes = self._stream.get_sensor_info().videoModes
            if len(modes) > 1:  # with a single one there may be nothing to set
                self._stream.set_video_mode(best_mode(modes, size))
            self._stream.start()
        except OpenNIError as error:
            self.close()
            raise DeviceError(f"no camera opens through OpenNI2: {words(error)}", PLUG) from error

    def grab(self, timeout_s: float) -> Image | None:
        """Return the newest picture, rgb8."""
        try:
            if openni2.wait_for_any_stream([self._stream], timeout_s) is None:
                return None
            stamp_s = time.monotonic()
            frame = self._stream.read_frame()
        except OpenNIError as error:
            raise DeviceError(f"the camera was lost: {words(error)}", PLUG) from error
        flat = np.frombuffer(frame.get_buffer_as_uint8(), np.uint8)
        rows = flat.reshape(frame.height, frame.stride)[:, : frame.width * 3]
        return Image(stamp_s, rows.reshape(frame.height, frame.width, 3).copy())

    def close(self) -> None:
        """Let go of the camera. The library stays loaded."""
        stream, device, self._stream, self._device = self._stream, self._device, None, None
        if stream is not None:
            quietly(stream.stop)
            time.sleep(SETTLE_S)
            quietly(stream.close)
            time.sleep(SETTLE_S)
        if device is not None:
            quietly(device.close)


def quietly(end: Callable[[], object]) -> None:
    """End something that may be gone already."""
    with contextlib.suppress(OpenNIError):
        end()


def load(folder: Path | None) -> None:
    """Load OpenNI2 from a folder, or from where OPENNI2_REDIST says. Raises `DeviceError`."""
    try:
        openni2.initialize(*([] if folder is None else [str(folder)]))
    except (InitializationError, OpenNIError, OSError) as error:
        why = str(error).splitlines()[-1].strip()
        raise DeviceError(f"OpenNI2 does not load: {why}", INSTALL) from error


def best_mode(modes: Any, size: tuple[int, int]) -> Any:
    """Choose the RGB mode nearest to (width, height), of these the fastest up to 30 Hz."""
    colour = [mode for mode in modes if mode.pixelFormat == openni2.PIXEL_FORMAT_RGB888]
    if not colour:
        raise DeviceError("the camera offers no RGB", PLUG)

    def distance(mode: Any) -> tuple[int, int]:
        return abs(mode.resolutionX - size[0]) + abs(mode.resolutionY - size[1]), abs(mode.fps - 30)

    return min(colour, key=distance)


def name_of(device: Any) -> str:
    """What a device calls itself."""
    return str(device.get_device_info().uri.decode())


def words(error: OpenNIError) -> str:
    """Text of an error of OpenNI2, in one line."""
    message = error.args[1] if len(error.args) > 1 else error
    text = message.decode("utf-8", "replace") if isinstance(message, bytes) else str(message)
    return " ".join(text.split())
