"""What the head of a JPEG or PNG says: size, which way up, and whether it is something that is not shown. Pure."""

from dataclasses import dataclass

from lira.hal.errors import SensorError
from lira.hal.messages.images import JPEG_END, JPEG_FRAMES, JPEG_SCAN, JPEG_START, PNG_START, jpeg_markers

EXIF = b"Exif\0\0"
UPRIGHT = 1
SIDEWAYS = 5  # from here on width and height are exchanged
_ORIENTATION = 0x0112
_TABLES, _APP1 = 0xC4, 0xE1  # markers (ITU T.81, table B.1)
_SIXTEEN = 16


@dataclass(frozen=True, slots=True)
class Header:
    """Size as it is stored, the Exif orientation (1: upright), and whether a JPEG brings its own Huffman tables."""

    width: int
    height: int
    orientation: int = UPRIGHT
    has_tables: bool = True

    @property
    def size(self) -> tuple[int, int]:
        """Width and height as it is to be looked at."""
        return (self.height, self.width) if self.orientation >= SIDEWAYS else (self.width, self.height)


def read_header(data: bytes) -> Header:
    """Read the head of a picture that was looked over before. Raises `SensorError`, by name, for what is not shown."""
    if data.startswith(PNG_START):
        return _read_png(data)
    if data.startswith(JPEG_START):
        return _read_jpeg(data)
    raise SensorError("what came is neither a JPEG nor a PNG")


def _read_png(data: bytes) -> Header:
    if data[24] == _SIXTEEN:
        raise SensorError("a picture has 16 bits a colour", "Use pictures of 8 bits; depth is no picture.")
    return Header(int.from_bytes(data[16:20]), int.from_bytes(data[20:24]))


def _read_jpeg(data: bytes) -> Header:
    size: tuple[int, int] | None = None
    scan: int | None = None
    orientation, has_tables = UPRIGHT, False
    for marker, at in jpeg_markers(data):
        if marker in JPEG_FRAMES:
            size = int.from_bytes(data[at + 7 : at + 9]), int.from_bytes(data[at + 5 : at + 7])
        has_tables |= marker == _TABLES
        if marker == _APP1:
            orientation = _orientation(data[at + 4 : at + 2 + int.from_bytes(data[at + 2 : at + 4])])
        if marker == JPEG_SCAN:
            scan = at
    if size is None or not all(size):
        raise SensorError("a JPEG does not say how large it is")
    # Nothing within the picture's own data looks like the end, and what a camera appends may.
    if scan is None or data.find(bytes((0xFF, JPEG_END)), scan) < 0:
        raise SensorError(f"a JPEG of {len(data)} bytes is cut off before its end")
    return Header(*size, orientation, has_tables)


def _orientation(segment: bytes) -> int:
    """Look the orientation up in an Exif segment (TIFF, first directory); upright if it does not say."""
    order = {b"II": "little", b"MM": "big"}.get(segment[6:8])
    if not segment.startswith(EXIF) or order is None:
        return UPRIGHT

    def number(at: int, size: int) -> int:
        return int.from_bytes(segment[6 + at : 6 + at + size], "little" if order == "little" else "big")

    first = number(4, 4)
    for entry in range(min(number(first, 2), 64)):
        at = first + 2 + 12 * entry
        if number(at, 2) == _ORIENTATION:
            value = number(at + 8, 2)
            return value if UPRIGHT <= value <= 8 else UPRIGHT
    return UPRIGHT
