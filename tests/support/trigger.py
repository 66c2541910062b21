"""A std_srvs/Trigger as it travels, by the CDR specification: what asks, and what is answered."""

import struct
from typing import NamedTuple

REQUEST = b"\x00\x01\x00\x00\x00"  # rosidl fills what has no fields with one byte


class Answered(NamedTuple):
    success: bool
    message: str


def read_answer(payload):
    """What was answered."""
    assert payload[:4] == b"\x00\x01\x00\x00"
    (success,), (length,) = struct.unpack_from("<?", payload, 4), struct.unpack_from("<I", payload, 8)
    text = payload[12 : 12 + length]
    assert len(text) == length
    assert text.endswith(b"\0")
    return Answered(success, text[:-1].decode())
