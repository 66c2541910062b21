"""A UVC camera or an RTSP stream, through FFmpeg's libraries (PyAV)."""

import contextlib
import time
from collections.abc import Iterator
from typing import Any

import av
import numpy as np

from lira.hal.errors import DeviceError, SensorError
from lira.hal.messages import CompressedImage, Image
from lira.robot.camera.address import Address, parse_address
from lira.robot.camera.fit import Size, check_shape
from lira.robot.camera.port import Picture
from lira.robot.camera.sources.drain import Drain, Frame
from lira.robot.camera.sources.stream_clock import LATE_S, StreamClock

OPEN_S, READ_S = 8.0, 5.0
SOCKET_US = "5000000"
NO_DELAY = {
    "fflags": "nobuffer+discardcorrupt",
    "flags": "low_delay",
    "fpsprobesize": "0",
    "analyzeduration": "1000000",
}
RTSP = {**NO_DELAY, "rtsp_flags": "prefer_tcp", "max_delay": "100000", "timeout": SOCKET_US}
UVC_RATE = "30"
# What the library lets through: its own errors, and Python's over what the stream said.
FAULTS = (av.FFmpegError, OSError, ValueError, TypeError, AttributeError, EOFError, MemoryError)
LARGEST_PIXELS = 4096 * 2304


class VideoSource:
    """What FFmpeg opens at `url`, in `size` (width, height) or one of that shape. Raises `DeviceError`."""

    def __init__(self, url: str, size: Size) -> None:
        self._address = parse_address(url)
        self._size = size
        try:
            self._container = open_container(url, self._address, size)
        except FAULTS as error:
            what = f"no camera opens at {self._address.shown}: {words(error)}"
            raise DeviceError(what, "Check address, name, password and path, and that nothing else uses it.") from error
        try:
            self._stream = self._container.streams.video[0]
            self._frames = self._decoded()
            if self._stream.codec_context.name == "mjpeg":
                self._frames = self._packets()
        except (IndexError, *FAULTS) as error:
            self._container.close()
            raise DeviceError(f"{self._address.shown} has no video", "Give the address of the video.") from error
        self._drain: Drain[Any] = Drain(self._read, self._container.close)

    def grab(self, timeout_s: float) -> Picture | None:
        """Return the newest picture: a JPEG as it came, or rgb8 in the size. Raises `SensorError`."""
        frame = self._drain.newest(timeout_s)
        if frame is None:
            return None
        if isinstance(frame.body, bytes):
            return CompressedImage(frame.arrived_s, frame.body)
        check_shape((frame.body.width, frame.body.height), self._size)
        width, height = self._size
        try:
            pixels = frame.body.reformat(width, height, format="rgb24").to_ndarray()
        except FAULTS as error:
            raise SensorError(f"a picture cannot be read: {words(error)}") from error
        return Image(frame.arrived_s, np.ascontiguousarray(pixels, np.uint8))

    def close(self) -> None:
        """Let go of the camera, as soon as the library comes back."""
        self._drain.close()

    def _read(self) -> Frame[Any] | None:
        try:
            return next(self._frames)
        except StopIteration:
            raise self._lost("it has ended") from None
        except FAULTS as error:
            raise self._lost(words(error)) from error

    def _packets(self) -> Iterator[Frame[Any] | None]:
        """JPEGs as they come: nothing is decoded that nobody asked for."""
        for packet in self._container.demux(self._stream):
            if packet.size:
                yield Frame(time.monotonic(), seconds(packet), bytes(packet))

    def _decoded(self) -> Iterator[Frame[Any] | None]:
        """Decode what comes; when that comes late, go on with the next picture that needs none before it."""
        decoder = self._stream.codec_context
        decoder.thread_type = "SLICE"  # by frames it would be a picture behind for each thread
        decoder.thread_count = 0
        clock, skipping = StreamClock(), False
        for packet in self._container.demux(self._stream):
            arrived_s, stream_s = time.monotonic(), seconds(packet)
            if stream_s is not None:
                skipping |= (clock.delay_s(arrived_s, stream_s) or 0.0) > LATE_S
            if skipping and not packet.is_keyframe:
                yield None
                continue
            skipping = False
            pictures = self._decode(packet)
            if pictures and pictures[-1].width * pictures[-1].height > LARGEST_PIXELS:
                raise ValueError("its pictures are too large")
            yield Frame(time.monotonic(), seconds(pictures[-1]), pictures[-1]) if pictures else None

    def _decode(self, packet: Any) -> list[Any]:
        """One packet that cannot be decoded is lost, and no more: the next key frame mends it."""
        with contextlib.suppress(av.error.InvalidDataError):
            return [picture for picture in packet.decode() if not picture.is_corrupt]
        return []

    def _lost(self, why: str) -> DeviceError:
        return DeviceError(f"the camera at {self._address.shown} was lost: {why}", "Check plug, power and network.")


def open_container(url: str, address: Address, size: Size) -> Any:
    """Open a device or an address. Raises `FAULTS`."""
    limits = (OPEN_S, READ_S)
    if not url.startswith("/dev/"):
        return av.open(url, options=RTSP if address.url.startswith("rtsp") else NO_DELAY, timeout=limits)
    wanted = {"video_size": f"{size[0]}x{size[1]}", "framerate": UVC_RATE}
    # Most cameras send large pictures fast enough only as JPEGs; and some take no size but their own.
    for more in ({**wanted, "input_format": "mjpeg"}, wanted):
        with contextlib.suppress(*FAULTS):
            return av.open(url, format="v4l2", options={**NO_DELAY, **more}, timeout=limits)
    return av.open(url, format="v4l2", options=NO_DELAY, timeout=limits)


def seconds(timed: Any) -> float | None:
    """The stream's own time of a packet or a picture; of a packet that of its decoding, which never runs back."""
    ticks = timed.pts if timed.dts is None else timed.dts
    return None if ticks is None or timed.time_base is None else float(ticks * timed.time_base)


def words(error: Exception) -> str:
    """Say why, without the address: it may hold a password."""
    return str(getattr(error, "strerror", None) or (error if isinstance(error, ValueError) else type(error).__name__))
