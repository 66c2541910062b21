"""A network camera that sends JPEGs one after the other over HTTP. They are passed on as they are."""

import http.client
import re
import time
from urllib.parse import urlsplit

from hal.errors import DeviceError
from hal.messages import CompressedImage

SILENCE_S = 1.0
READ_SIZE = 65536
LARGEST_BYTES = 8_000_000  # a picture that does not end is none
LENGTH = re.compile(rb"^content-length:\s*(\d+)", re.IGNORECASE | re.MULTILINE)


class MjpegSource:
    """The stream at `url`. Raises `DeviceError`."""

    def __init__(self, url: str) -> None:
        self._url = url
        parts = urlsplit(url)
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        try:
            self._connection = kind(parts.hostname or "", parts.port, timeout=SILENCE_S)
            self._connection.request("GET", (parts.path or "/") + (f"?{parts.query}" if parts.query else ""))
            self._answer = self._connection.getresponse()
        except (OSError, ValueError, http.client.HTTPException) as error:
            raise DeviceError(f"no camera answers at {url}: {error}", "Check the address and the network.") from error
        headers, self._buffer = self._answer.headers, b""
        self._boundary = str(headers.get_param("boundary", "")).strip('"').removeprefix("--").encode()
        if self._answer.status != http.HTTPStatus.OK or headers.get_content_type() != "multipart/x-mixed-replace":
            self.close()
            what = f"{url} is no MJPEG stream ({self._answer.status}, {headers.get_content_type()})"
            raise DeviceError(what, "Give the address of the stream itself.")

    def grab(self, timeout_s: float) -> CompressedImage | None:
        """Return the newest picture that is complete; older ones that came with it are passed over."""
        until_s = time.monotonic() + timeout_s
        while time.monotonic() < until_s:
            try:
                data = self._answer.read1(READ_SIZE)
            except (OSError, http.client.HTTPException) as error:
                raise self._lost(error) from error
            if not data:
                raise self._lost("it closed the stream")
            stamp_s = time.monotonic()
            pictures, self._buffer = parse_parts(self._buffer + data, self._boundary)
            if pictures:
                return CompressedImage(stamp_s, pictures[-1])
            if len(self._buffer) > LARGEST_BYTES:
                raise self._lost("its pictures have no end")
        return None

    def close(self) -> None:
        """Let go of the stream."""
        self._answer.close()
        self._connection.close()

    def _lost(self, why: object) -> DeviceError:
        return DeviceError(f"the camera at {self._url} was lost: {why}", "Check its power and the network.")


def parse_parts(buffer: bytes, boundary: bytes) -> tuple[list[bytes], bytes]:
    """Return the bodies of all complete parts of a multipart stream, and what is left.

    A part ends where its own length says, or else before the next boundary.
    """
    bodies: list[bytes] = []
    mark = b"--" + boundary
    while True:
        start = buffer.find(mark)
        head_end = buffer.find(b"\r\n\r\n", start)
        if start < 0 or head_end < 0:
            return bodies, buffer[start:] if start >= 0 else buffer[-len(mark) :]
        body_at = head_end + 4
        length = LENGTH.search(buffer, start, head_end)
        end = body_at + int(length[1]) if length else buffer.find(b"\r\n" + mark, body_at)
        if end < body_at or len(buffer) < end:
            return bodies, buffer[start:]
        bodies.append(buffer[body_at:end])
        buffer = buffer[end:]
