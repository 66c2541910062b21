"""rosserial as the board's library speaks it: its reader, byte by byte, and the pieces of its messages."""

import struct
from enum import IntEnum, auto

INPUT_SIZE = 512
FRAME_S = 0.02  # a frame has to be complete so long after its first byte


class Mode(IntEnum):
    """What the reader expects next."""

    FIRST_FF = auto()
    SECOND = auto()
    SIZE_LOW = auto()
    SIZE_HIGH = auto()
    SIZE_CHECK = auto()
    TOPIC_LOW = auto()
    TOPIC_HIGH = auto()
    MESSAGE = auto()
    CHECK = auto()


class Reader:
    """The library's state machine. A frame that loses a byte takes the first bytes of the next one with it.

    It writes a message into memory as long as its frame says: a longer one than its buffer leaves it `overrun`.
    """

    def __init__(self) -> None:
        self._mode = Mode.FIRST_FF
        self._give_up_s = 0.0
        self._left = self._sum = self._topic = 0
        self._message = bytearray()
        self.overrun = False

    def read(self, data: bytes, now_s: float) -> list[tuple[int, bytes]]:
        """Take bytes; returns the frames that they complete, as topic and payload."""
        if self._mode is not Mode.FIRST_FF and now_s > self._give_up_s:
            self._mode = Mode.FIRST_FF
        frames = []
        for byte in data:
            frame = self._step(byte, now_s)
            if frame is not None:
                frames.append(frame)
        return frames

    def _step(self, byte: int, now_s: float) -> tuple[int, bytes] | None:
        mode = self._mode
        self._sum += byte
        if mode is Mode.FIRST_FF:
            if byte == 0xFF:
                self._mode, self._give_up_s = Mode.SECOND, now_s + FRAME_S
        elif mode is Mode.SECOND:
            self._mode = Mode.SIZE_LOW if byte == 0xFE else Mode.FIRST_FF
        elif mode is Mode.SIZE_LOW:
            self._left = self._sum = byte
            self._mode = Mode.SIZE_HIGH
        elif mode is Mode.SIZE_HIGH:
            self._left += byte << 8
            self._mode = Mode.SIZE_CHECK
        elif mode is Mode.SIZE_CHECK:
            self._mode = Mode.TOPIC_LOW if self._sum % 256 == 255 else Mode.FIRST_FF
        elif mode is Mode.TOPIC_LOW:
            self._topic = self._sum = byte
            self._mode = Mode.TOPIC_HIGH
        elif mode is Mode.TOPIC_HIGH:
            self._topic += byte << 8
            self._message.clear()
            self._mode = Mode.MESSAGE if self._left else Mode.CHECK
        elif mode is Mode.MESSAGE:
            self._message.append(byte)
            self._left -= 1
            self.overrun |= len(self._message) > INPUT_SIZE
            if not self._left:
                self._mode = Mode.CHECK
        else:
            self._mode = Mode.FIRST_FF
            if self._sum % 256 == 255:
                return self._topic, bytes(self._message)
        return None


def encode(topic: int, payload: bytes) -> bytes:
    """Frame a message."""
    size, body = struct.pack("<H", len(payload)), struct.pack("<H", topic) + payload
    checks = [255 - sum(part) % 256 for part in (size, body)]
    return b"\xff\xfe" + size + bytes(checks[:1]) + body + bytes(checks[1:])


def header(stamp_s: float, frame: str) -> bytes:
    """std_msgs/Header of ROS 1."""
    nanoseconds = int(max(stamp_s, 0.0) * 1e9)
    return struct.pack("<III", 0, nanoseconds // 10**9, nanoseconds % 10**9) + pack_string(frame)


def topic_info(number: int, name: str, kind: str, md5: str) -> bytes:
    """rosserial_msgs/TopicInfo."""
    texts = b"".join(pack_string(text) for text in (name, kind, md5))
    return struct.pack("<H", number) + texts + struct.pack("<i", INPUT_SIZE)


def log(level: int, text: str) -> bytes:
    """rosserial_msgs/Log."""
    return bytes([level]) + pack_string(text)


def pack_string(text: str) -> bytes:
    """Length and bytes."""
    return struct.pack("<I", len(text)) + text.encode("ascii")


def unpack_string(data: bytes) -> tuple[str, bytes]:
    """Return the text and what follows it."""
    size = struct.unpack_from("<I", data)[0]
    return data[4 : 4 + size].decode("ascii"), data[4 + size :]
