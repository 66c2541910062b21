"""The Orbbec Astra's colour and depth cameras through OpenNI2."""

import contextlib
import ctypes
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from openni import _openni2, openni2
from openni.utils import ClosedHandle, InitializationError, OpenNIError

from lira.hal.bus.topics import DEPTH
from lira.hal.errors import DeviceError, SensorError
from lira.hal.messages import DepthImage, Image

# A driver's own thread may still be at its last picture when the stream has stopped; to close it then crashes.
SETTLE_S = 0.15
EARLY = 0.9  # of the period of a depth: a frame that comes a little early still counts
INSTALL = (
    "Give the folder of Orbbec's OpenNI2 (with libOpenNI2.so and OpenNI2/Drivers in it) by --openni or OPENNI2_REDIST."
)
# What the package lets through: its own errors, and those of ctypes and numpy over what the driver gave.
FAULTS = (OpenNIError, OSError, ValueError, TypeError, AttributeError, ctypes.ArgumentError)
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
    """Colour, and depth if wanted, of the OpenNI2 device `uri`, or of the first there is if that is empty.

    Raises `DeviceError`.
    """

    def __init__(self, uri: str, size: tuple[int, int], folder: Path | None, *, depth: bool = False) -> None:
        self._device: Any = None
        self._colour: Any = None
        self._depth: Any = None
        self._depth_due_s = 0.0
        load(folder)
        try:
            self._device = Device(uri.encode() or None)
            self._colour = self._open_stream("colour", self._device.create_color_stream, colour_modes, size)
            if depth:
                self._depth = self._open_stream("depth", self._device.create_depth_stream, depth_modes, size)
        except FAULTS as error:
            self.close()
            raise DeviceError(f"no camera opens through OpenNI2: {words(error)}", PLUG) from error
        except DeviceError:
            self.close()
            raise

    def grab(self, timeout_s: float) -> Image | DepthImage | None:
        """Return the newest picture, rgb8, or the newest depth."""
        streams = [stream for stream in (self._colour, self._depth) if stream is not None]
        try:
            ready = openni2.wait_for_any_stream(streams, timeout_s)
            if ready is None:
                return None
            stamp_s = time.monotonic()
            frame = ready.read_frame()
        except FAULTS as error:
            raise DeviceError(f"the camera was lost: {words(error)}", PLUG) from error
        if ready is self._depth:
            if stamp_s < self._depth_due_s:
                return None
            self._depth_due_s = stamp_s + EARLY / DEPTH.rate_hz
        try:
            return depth_of(frame, stamp_s) if ready is self._depth else colour_of(frame, stamp_s)
        except FAULTS as error:
            raise SensorError(f"a picture of the camera cannot be read: {error}") from error

    def close(self) -> None:
        """Let go of the camera. The library stays loaded."""
        streams = [stream for stream in (self._colour, self._depth) if stream is not None]
        device, self._device, self._colour, self._depth = self._device, None, None, None
        for stream in streams:
            quietly(stream.stop)
        if streams:
            time.sleep(SETTLE_S)
        for stream in streams:
            quietly(stream.close)
        if streams:
            time.sleep(SETTLE_S)
        if device is not None:
            quietly(device.close)

    def _open_stream(
        self, what: str, create: Callable[[], Any], usable: Callable[[Any], list[Any]], size: tuple[int, int]
    ) -> Any:
        stream = create()
        if stream is None:
            raise DeviceError(f"the OpenNI2 device {name_of(self._device)} has no {what}", PLUG)
        modes = usable(stream.get_sensor_info().videoModes)
        if not modes:
            raise DeviceError(f"the OpenNI2 device {name_of(self._device)} has no {what} that is understood", PLUG)
        if len(modes) > 1:  # with a single one there may be nothing to set
            stream.set_video_mode(best_mode(modes, size))
        stream.start()
        return stream


def colour_of(frame: Any, stamp_s: float) -> Image:
    """Return the colours of a frame."""
    flat = np.frombuffer(frame.get_buffer_as_uint8(), np.uint8)
    rows = flat.reshape(frame.height, frame.stride)[:, : frame.width * 3]
    return Image(stamp_s, rows.reshape(frame.height, frame.width, 3).copy())


def depth_of(frame: Any, stamp_s: float) -> DepthImage:
    """Return the depths of a frame, mm."""
    depths = np.frombuffer(frame.get_buffer_as_uint16(), np.uint16).reshape(frame.height, frame.stride // 2)
    return DepthImage(stamp_s, depths[:, : frame.width].copy())


def quietly(end: Callable[[], object]) -> None:
    """End something that may be gone already."""
    with contextlib.suppress(*FAULTS):
        end()


def load(folder: Path | None) -> None:
    """Load OpenNI2 from a folder, or from where OPENNI2_REDIST says. Raises `DeviceError`."""
    try:
        openni2.initialize(*([] if folder is None else [str(folder)]))
    except (InitializationError, *FAULTS) as error:
        forget_failed_load()
        why = (str(error).splitlines() or [type(error).__name__])[-1].strip()
        raise DeviceError(f"OpenNI2 does not load: {why}", INSTALL) from error


def forget_failed_load() -> None:
    """The package keeps a library that did not start and refuses every other; the library believes that it did."""
    if openni2.loaded_dll_directory is None and _openni2._the_dll is not None:
        quietly(_openni2.oniShutdown)
        _openni2._the_dll = None


def colour_modes(modes: Any) -> list[Any]:
    """Those that give RGB."""
    return [mode for mode in modes if mode.pixelFormat == openni2.PIXEL_FORMAT_RGB888]


def depth_modes(modes: Any) -> list[Any]:
    """Those that give millimetres."""
    return [mode for mode in modes if mode.pixelFormat == openni2.PIXEL_FORMAT_DEPTH_1_MM]


def best_mode(modes: list[Any], size: tuple[int, int]) -> Any:
    """Choose the mode nearest to (width, height), of these the fastest up to 30 Hz."""

    def distance(mode: Any) -> tuple[int, int]:
        return abs(mode.resolutionX - size[0]) + abs(mode.resolutionY - size[1]), abs(mode.fps - 30)

    return min(modes, key=distance)


def name_of(device: Any) -> str:
    """What a device calls itself."""
    return str(device.get_device_info().uri.decode())


def words(error: Exception) -> str:
    """Text of an error of OpenNI2, in one line."""
    message = error.args[1] if len(error.args) > 1 else error
    text = message.decode("utf-8", "replace") if isinstance(message, bytes) else str(message)
    return " ".join(text.split())
