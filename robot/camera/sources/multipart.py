"""Parts of a multipart stream, as network cameras send them: one JPEG after the other. Pure."""

import re
from typing import NamedTuple

from lira.robot.camera.port import LARGEST_BYTES

LARGEST_HEAD = 8192  # a part whose head is longer is none
LENGTH = re.compile(rb"^content-length:[ \t]*(\d+)", re.IGNORECASE | re.MULTILINE)
LENGTH_DIGITS = len(str(LARGEST_BYTES))
TIMESTAMP = re.compile(rb"^x-timestamp:[ \t]*(\d{1,12}(?:\.\d{1,9})?)[ \t]*\r?$", re.IGNORECASE | re.MULTILINE)
BOUNDARY = re.compile(rb"(?:^|\r\n)--([0-9A-Za-z'()+_,\-./:=?]{1,70})[ \t]*\r\n(?=[!-9;-~]+:)")


class Part(NamedTuple):
    """What one part holds, and the stream's own time of it in seconds, if it says (X-Timestamp)."""

    body: bytes
    stream_s: float | None


def find_boundary(start: bytes) -> bytes:
    """Return the boundary of a stream that does not name it, by how it begins; b"" if it is no such stream."""
    found = BOUNDARY.search(start, 0, LARGEST_HEAD)
    return b"" if found is None else found[1]


def parse_parts(buffer: bytes, boundary: bytes) -> tuple[list[Part], bytes]:
    """Return all complete parts of a multipart stream, and what is left, which is bounded.

    A part ends where its own length says, or else before the next boundary. One that is longer than a picture, by what
    it says or by what has come, is passed over.
    """
    parts: list[Part] = []
    mark = b"--" + boundary
    at = 0
    while True:
        start = buffer.find(mark, at)
        if start < 0:
            return parts, buffer[max(at, len(buffer) - len(mark)) :]
        body_at, end = _extent(buffer, start, mark)
        if end is None:
            at = start + len(mark)
        elif end > len(buffer):
            return parts, buffer[start:]
        else:
            stamp = TIMESTAMP.search(buffer, start, body_at)
            parts.append(Part(buffer[body_at:end], None if stamp is None else float(stamp[1])))
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
