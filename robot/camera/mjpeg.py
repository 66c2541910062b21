"""A network camera that sends JPEGs one after the other over HTTP. They are passed on as they are."""

import contextlib
import http.client
import re
import time
from urllib.parse import urlsplit

from lira.hal.errors import DeviceError
from lira.hal.messages import CompressedImage
from lira.robot.camera.port import LARGEST_BYTES

SILENCE_S = 1.0
READ_SIZE = 65536
LARGEST_HEAD = 8192  # a part whose head is longer is none
LENGTH = re.compile(rb"^content-length:[ \t]*(\d+)", re.IGNORECASE | re.MULTILINE)
LENGTH_DIGITS = len(str(LARGEST_BYTES))
FAULTS = (OSError, ValueError, AttributeError, http.client.HTTPException)  # what http.client lets through


class MjpegSource:
    """The stream at `url`. Raises `DeviceError`."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._connection: http.client.HTTPConnection | None = None
        self._answer: http.client.HTTPResponse | None = None
        self._buffer = b""
        try:
            answer = self._answer = self._connect()
            self._boundary = (answer.headers.get_boundary("") or "").removeprefix("--").encode()
        except FAULTS as error:
            self.close()
            raise DeviceError(f"no camera answers at {url}: {error}", "Check the address and the network.") from error
        kind = answer.headers.get_content_type()
        if answer.status != http.HTTPStatus.OK or kind != "multipart/x-mixed-replace" or not self._boundary:
            self.close()
            what = f"{url} is no MJPEG stream ({answer.status}, {kind})"
            raise DeviceError(what, "Give the address of the stream itself.")

    def _connect(self) -> http.client.HTTPResponse:
        parts = urlsplit(self._url)
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        self._connection = kind(parts.hostname or "", parts.port, timeout=SILENCE_S)
        self._connection.request("GET", (parts.path or "/") + (f"?{parts.query}" if parts.query else ""))
        return self._connection.getresponse()

    def grab(self, timeout_s: float) -> CompressedImage | None:
        """Return the newest picture that is complete; older ones that came with it are passed over."""
        assert self._answer is not None
        until_s = time.monotonic() + timeout_s
        while time.monotonic() < until_s:
            try:
                data = self._answer.read1(READ_SIZE)
            except FAULTS as error:
                raise self._lost(error) from error
            if not data:
                raise self._lost("it closed the stream")
            stamp_s = time.monotonic()
            pictures, self._buffer = parse_parts(self._buffer + data, self._boundary)
            if pictures:
                return CompressedImage(stamp_s, pictures[-1])
        return None

    def close(self) -> None:
        """Let go of the stream."""
        for end in (self._answer, self._connection):
            if end is not None:
                with contextlib.suppress(*FAULTS):
                    end.close()

    def _lost(self, why: object) -> DeviceError:
        return DeviceError(f"the camera at {self._url} was lost: {why}", "Check its power and the network.")


def parse_parts(buffer: bytes, boundary: bytes) -> tuple[list[bytes], bytes]:
    """Return the bodies of all complete parts of a multipart stream, and what is left, which is bounded.

    A part ends where its own length says, or else before the next boundary. One that is longer than a picture, by what
    it says or by what has come, is passed over.
    """
    bodies: list[bytes] = []
    mark = b"--" + boundary
    at = 0
    while True:
        start = buffer.find(mark, at)
        if start < 0:
            return bodies, buffer[max(at, len(buffer) - len(mark)) :]
        body_at, end = _extent(buffer, start, mark)
        if end is None:
            at = start + len(mark)
        elif end > len(buffer):
            return bodies, buffer[start:]
        else:
            bodies.append(buffer[body_at:end])
            at = end


def _extent(buffer: bytes, start: int, mark: bytes) -> tuple[int, int | None]:
    """Where the body of a part begins, and ends: behind the buffer if it is not complete, None if it is none."""
    body_at = buffer.find(b"\r\n\r\n", start, start + LARGEST_HEAD) + 4
    later = len(buffer) + 1
    if body_at < 4:
        return 0, later if len(buffer) - start < LARGEST_HEAD else None
    length = LENGTH.search(buffer, start, body_at)
    if length is not None:
        size = int(length[1]) if len(length[1]) <= LENGTH_DIGITS else LARGEST_BYTES + 1
        return body_at, body_at + size if size <= LARGEST_BYTES else None
    end = buffer.find(b"\r\n" + mark, body_at, body_at + LARGEST_BYTES)
    if end < 0:
        return body_at, later if len(buffer) - body_at < LARGEST_BYTES else None
    return body_at, end
