"""A network camera that sends JPEGs one after the other over HTTP."""

import fcntl
import struct
import termios
import time

from lira.hal.errors import DeviceError
from lira.hal.messages import CompressedImage
from lira.robot.camera.address import Address, parse_address
from lira.robot.camera.sources.drain import Drain, Frame
from lira.robot.camera.sources.http_stream import FAULTS, HttpStream, words
from lira.robot.camera.sources.multipart import LARGEST_HEAD, find_boundary, parse_parts

FIRST_S = 10.0  # until the first picture: some cameras begin slowly
SILENCE_S = 1.0
READ_SIZE = 262_144
PLAIN = "application/octet-stream"  # what servers say that do not know what they send


class MjpegSource:
    """The stream at `url`, http or https, with a name and a password in it if need be. Raises `DeviceError`."""

    def __init__(self, url: str) -> None:
        self._address: Address = parse_address(url)
        self._stream = HttpStream(self._address)
        self._boundary = self._stream.boundary
        self._buffer = b""
        self._began = False
        if not self._boundary and self._stream.kind != PLAIN and not self._stream.kind.startswith("multipart/"):
            self._stream.close()
            what = f"{self._address.shown} is no MJPEG stream ({self._stream.kind})"
            raise DeviceError(what, "Give the address of the stream itself.")
        self._stream.set_timeout(FIRST_S)
        self._drain: Drain[bytes] = Drain(self._read, self._stream.close)

    def grab(self, timeout_s: float) -> CompressedImage | None:
        """Return the newest picture; what came before it is passed over."""
        frame = self._drain.newest(timeout_s)
        return None if frame is None else CompressedImage(frame.arrived_s, frame.body)

    def close(self) -> None:
        """Let go of the stream."""
        self._stream.shut_down()
        self._drain.close()

    def _read(self) -> Frame[bytes] | None:
        """What came last of what has come; None if that is no whole picture, or a newer one waits already."""
        try:
            data = self._stream.read(READ_SIZE)
        except FAULTS as error:
            raise self._lost(words(error)) from error
        arrived_s = time.monotonic()
        if not data:
            raise self._lost("it closed the stream")
        self._buffer += data
        if not self._boundary and not self._find_boundary():
            return None
        parts, self._buffer = parse_parts(self._buffer, self._boundary)
        if not parts:
            return None
        if not self._began:
            self._began = True
            self._stream.set_timeout(SILENCE_S)
        body, stream_s = parts[-1]
        if self._waiting() >= max(len(body), READ_SIZE):
            return None
        return Frame(arrived_s, stream_s, body)

    def _find_boundary(self) -> bool:
        self._boundary = find_boundary(self._buffer)
        if not self._boundary and len(self._buffer) > LARGEST_HEAD:
            what = f"what comes from {self._address.shown} is no MJPEG stream: it has no boundaries"
            raise DeviceError(what, "Set the camera to multipart JPEGs.")
        return bool(self._boundary)

    def _waiting(self) -> int:
        """Bytes that have come and were not read yet."""
        try:
            return int(struct.unpack("i", fcntl.ioctl(self._stream.socket, termios.FIONREAD, bytes(4)))[0])
        except (OSError, ValueError):
            return 0

    def _lost(self, why: str) -> DeviceError:
        return DeviceError(f"the camera at {self._address.shown} was lost: {why}", "Check its power and the network.")
