"""Pictures off the bus are looked over before a decoder gets them: few bytes can ask it for seconds and gigabytes."""

from collections.abc import Iterator

PNG_START = b"\x89PNG\r\n\x1a\n"
JPEG_START = b"\xff\xd8"
CHUNK_FRAME = 12  # length, type and checksum around what a chunk holds
LARGEST_BYTES = 8 * 2**20  # of pixels, decoded: 1920 x 1080 in colour
MOST_SCANS = 64  # of a progressive JPEG; each goes over all pixels once more

JPEG_FRAMES = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})  # markers of a frame header (ITU T.81, table B.1)
JPEG_SCAN, JPEG_END = 0xDA, 0xD9

_PNG_CHANNELS = {0: 1, 2: 3, 3: 3, 4: 2, 6: 4}  # by colour type; an index stands for a colour
_JPEG_BARE = frozenset({0x00, 0x01, *range(0xD0, 0xD9)})  # markers without a length, and what is none


def objection(data: bytes) -> str:
    """Say why a picture is not to be decoded, "" if it may be. Whether it is whole, only the decoder can tell."""
    if data.startswith(PNG_START):
        return _png_objection(data)
    if data.startswith(JPEG_START):
        return _jpeg_objection(data)
    return "neither a JPEG nor a PNG"


def _png_objection(data: bytes) -> str:
    """OpenCV sets aside what a part claims, up to 4 GB, before it finds out, which takes it most of a minute."""
    at = len(PNG_START)
    while at < len(data):
        at += CHUNK_FRAME + int.from_bytes(data[at : at + 4])
    if at != len(data):
        return "a part of the picture is longer than the picture"
    head = data[16:26]  # width, height, bits and colour type, in the first chunk
    if len(head) < 10 or data[12:16] != b"IHDR" or head[9] not in _PNG_CHANNELS:
        return "no header"
    width, height = int.from_bytes(head[:4]), int.from_bytes(head[4:8])
    return _size_objection(width, height, _PNG_CHANNELS[head[9]] * max(head[8], 8) // 8)


def jpeg_markers(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the markers of a JPEG that have a length, and where each begins, up to its first scan or its end.

    A decoder skips what is no marker, so this does, too.
    """
    at = len(JPEG_START)
    while (at := data.find(b"\xff", at)) >= 0 and at + 1 < len(data):
        marker = data[at + 1]
        if marker == 0xFF or marker in _JPEG_BARE:
            at += 1 if marker == 0xFF else 2
            continue
        yield marker, at
        if marker in (JPEG_SCAN, JPEG_END):
            return
        at += 2 + max(int.from_bytes(data[at + 2 : at + 4]), 2)


def _jpeg_objection(data: bytes) -> str:
    for marker, at in jpeg_markers(data):
        if marker in JPEG_FRAMES and at + 10 <= len(data):
            height, width = int.from_bytes(data[at + 5 : at + 7]), int.from_bytes(data[at + 7 : at + 9])
            if why := _size_objection(width, height, max(data[at + 9], 3)):
                return why
        if marker == JPEG_SCAN and data.count(b"\xff\xda", at) > MOST_SCANS:
            return "too many scans"
    return ""


def _size_objection(width: int, height: int, bytes_each: int) -> str:
    large = width * height * bytes_each > LARGEST_BYTES
    return f"{width} x {height} pixels are more than are decoded here" if large else ""


def size_of(data: bytes) -> tuple[int, int]:
    """Width and height of a picture, by its header. Raises `ValueError` for one without."""
    if data.startswith(PNG_START) and len(data) >= 24:
        return int.from_bytes(data[16:20]), int.from_bytes(data[20:24])
    frame = _jpeg_frame(data)
    if frame is None:
        raise ValueError("a picture without a header")
    return int.from_bytes(data[frame + 7 : frame + 9]), int.from_bytes(data[frame + 5 : frame + 7])


def picture_format(data: bytes) -> str:
    """Name a picture by what its bytes are: "png" or "jpeg"."""
    return "png" if data.startswith(PNG_START) else "jpeg"


def transport_format(data: bytes) -> str:
    """Name a picture as ROS's image_transport does: what it was, how it is compressed, and to what.

    Its subscriber takes what is named otherwise for eight bits of gray or colour, and a depth for a picture.
    """
    if data.startswith(PNG_START):
        bits, kind = (data[24], data[25]) if len(data) > 25 else (8, 2)
        if _PNG_CHANNELS.get(kind) == 1 and kind != 3:
            return f"{'16UC1' if bits == 16 else 'mono8'}; png compressed"
        return "rgb8; png compressed bgr8"
    frame = _jpeg_frame(data)
    gray = frame is not None and data[frame + 9] == 1
    return "mono8; jpeg compressed" if gray else "rgb8; jpeg compressed bgr8"


def _jpeg_frame(data: bytes) -> int | None:
    """Where a JPEG's frame header is, None for nowhere."""
    return next((at for marker, at in jpeg_markers(data) if marker in JPEG_FRAMES and at + 10 <= len(data)), None)
