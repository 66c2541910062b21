"""What rides beside every payload of ours: who sent it, in which order, when, and what it answers."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from lira.hal.clock import TimeBase
from lira.hal.errors import CodecError

MAGIC = b"LIR1"
_LAYOUT = struct.Struct("<4sQQqqB")
_RELEASED = 1
_COUNTS = range(2**63)  # what a message's int64 holds
_TIMES = range(-(2**62), 2**62)  # in nanoseconds: some that lie apart can still be told from one another


@dataclass(frozen=True, slots=True)
class Attachment:
    """One sample's attachment.

    `epoch` is random per session, so a restarted sender is seen; `seq` grows within it (for sensors it is the number
    of the observation). `time_ns` is when it was sent, on the robot's clock or a client's estimate of it.
    `answers` is the observation a command or its result belongs to, -1 for none; `released` as in `Command`.
    """

    epoch: int
    seq: int
    time_ns: int
    answers: int = -1
    released: bool = False

    @property
    def time_s(self) -> float:
        """When it was sent, in seconds on the robot's clock."""
        return self.time_ns / 1e9

    def to_bytes(self) -> bytes:
        """Pack for the wire: 37 bytes, little-endian."""
        flags = _RELEASED if self.released else 0
        return _LAYOUT.pack(MAGIC, self.epoch, self.seq, self.time_ns, self.answers, flags)


def parse_attachment(data: bytes | None) -> Attachment | None:
    """Unpack an attachment; None for no attachment or one that is not ours (ROS peers attach their own).

    Raises `CodecError` for one of ours with a number that is out of bounds.
    """
    if data is None or len(data) != _LAYOUT.size or not data.startswith(MAGIC):
        return None
    _, epoch, seq, time_ns, answers, flags = _LAYOUT.unpack(data)
    if seq not in _COUNTS or time_ns not in _TIMES or not (answers == -1 or answers in _COUNTS):
        raise CodecError(f"an attachment of seq {seq}, {time_ns} ns, answers {answers} is out of bounds")
    return Attachment(epoch, seq, time_ns, answers, bool(flags & _RELEASED))


def attach(
    epoch: int,
    count: Iterator[int],
    base: TimeBase,
    time_s: float,
    seq: int | None,
    answers: int,
    *,
    released: bool,
) -> bytes:
    """Make one for a session that counts what it sends and tells times by its `base`; `seq` instead of the count."""
    number = next(count) if seq is None else seq
    return Attachment(epoch, number, round(time_s * 1e9) + base.offset_ns, answers, released).to_bytes()
