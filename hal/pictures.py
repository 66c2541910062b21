"""Pictures off the bus are looked over before a decoder gets them."""

PNG_START = b"\x89PNG\r\n\x1a\n"
CHUNK_FRAME = 12  # length, type and checksum around what a chunk holds


def is_sound(data: bytes) -> bool:
    """Whether no part of a PNG claims to be longer than what there is; other formats cannot claim much.

    OpenCV sets aside what a part claims, up to 4 GB, before it finds out, which takes it most of a minute.
    """
    at = len(PNG_START)
    while data.startswith(PNG_START) and at < len(data):
        at += CHUNK_FRAME + int.from_bytes(data[at : at + 4])
    return not data.startswith(PNG_START) or at == len(data)
