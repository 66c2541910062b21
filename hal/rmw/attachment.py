"""What rmw_zenoh attaches to each sample: its number, when it was sent, by whom.

Two forms, both little-endian. Now 33 bytes: number and time as int64, then 16 bytes of id behind their count. Earlier
each of the three stood behind its name. A subscriber of rmw_zenoh drops a sample without one, and fails on one of
another form: what goes out is always the first. Whatever comes in is read as far as it can be, and else ignored.
"""

import struct
from dataclasses import dataclass
from hashlib import blake2b

GID_BYTES = 16
_NOW = struct.Struct("<qqB16s")
_EARLIER = struct.Struct("<16sq17sq11sB16s")
_NAMES = b"\x0fsequence_number", b"\x10source_timestamp", b"\x0asource_gid"


@dataclass(frozen=True, slots=True)
class RmwAttachment:
    """One sample's. `time_ns` is the sender's Unix time; `gid` tells its publishers and clients apart."""

    number: int
    time_ns: int
    gid: bytes

    def to_bytes(self) -> bytes:
        """Pack for the wire: 33 bytes."""
        return _NOW.pack(self.number, self.time_ns, GID_BYTES, self.gid)


def parse_rmw_attachment(data: bytes | None) -> RmwAttachment | None:
    """Unpack either form; None for no attachment or any other."""
    if data is None:
        return None
    if len(data) == _NOW.size:
        number, time_ns, count, gid = _NOW.unpack(data)
        return RmwAttachment(number, time_ns, gid) if count == GID_BYTES else None
    if len(data) == _EARLIER.size:
        first, number, second, time_ns, third, count, gid = _EARLIER.unpack(data)
        if (first, second, third) == _NAMES and count == GID_BYTES:
            return RmwAttachment(number, time_ns, gid)
    return None


def gid_of(token: str) -> bytes:
    """Id of whoever declares a liveliness token, always the same for the same token.

    rmw_zenoh takes another hash of it. Nothing compares the two: an id has to differ from all others, no more.
    """
    return blake2b(token.encode(), digest_size=GID_BYTES).digest()
