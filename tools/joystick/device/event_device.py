"""An input device of the kernel, as linux/input.h has it: opened, read, made to rumble. Needs no package."""

import contextlib
import errno
import fcntl
import os
import struct

from lira.tools.joystick.axes import PadEvent

EVENT = struct.Struct("@llHHi")  # time of two longs, type, code, value
ABS_INFO = struct.Struct("@6i")  # value, minimum, maximum, fuzz, flat, resolution
KEY_BYTES = 96  # of a bit for each key there is
AT_ONCE = 64  # events in one read
FF_RUMBLE = 0x50
EV_FF = 0x15
_EFFECT_HEAD = "@HhHHHHH"  # type, id, direction, trigger button and interval, replay length and delay
_EFFECT_BYTES = 48 if struct.calcsize("P") == 8 else 44  # a union that holds a pointer follows
_READ, _WRITE = 2, 1


def _request(direction: int, number: int, size: int) -> int:
    return direction << 30 | size << 16 | ord("E") << 8 | number


class EventDevice:
    """An open /dev/input/event*, for reading and, where that is allowed, for rumbling. Raises `OSError`."""

    def __init__(self, path: str) -> None:
        self.path = path
        flags = os.O_NONBLOCK | os.O_CLOEXEC
        try:
            self.fd = os.open(path, os.O_RDWR | flags)
        except OSError as error:
            if error.errno not in (errno.EACCES, errno.EPERM, errno.EROFS):
                raise
            self.fd = os.open(path, os.O_RDONLY | flags)

    def read(self) -> list[PadEvent]:
        """What came, without waiting. Raises `OSError` when it is gone, `EOFError` when it was closed."""
        try:
            data = os.read(self.fd, AT_ONCE * EVENT.size)
        except BlockingIOError:
            return []
        if not data:
            raise EOFError(self.path)
        whole = len(data) - len(data) % EVENT.size
        return [PadEvent(kind, code, value) for _, _, kind, code, value in EVENT.iter_unpack(data[:whole])]

    def axis(self, code: int) -> tuple[int, int, int]:
        """An axis: what it reads, its least and its greatest. Raises `OSError`."""
        data = fcntl.ioctl(self.fd, _request(_READ, 0x40 + code, ABS_INFO.size), bytes(ABS_INFO.size))
        value, minimum, maximum, *_ = ABS_INFO.unpack(data)
        return value, minimum, maximum

    def pressed(self) -> frozenset[int]:
        """Codes of what is pressed. Raises `OSError`."""
        data = fcntl.ioctl(self.fd, _request(_READ, 0x18, KEY_BYTES), bytes(KEY_BYTES))
        bits = int.from_bytes(data, "little")
        return frozenset(code for code in range(8 * KEY_BYTES) if bits >> code & 1)

    def upload_rumble(self, level: int, longest_ms: int) -> int:
        """Give it a rumble of a strength up to 65535 that ends by itself; its number. Raises `OSError`."""
        head = struct.pack(_EFFECT_HEAD, FF_RUMBLE, -1, 0, 0, 0, longest_ms, 0)
        effect = bytearray(head.ljust(16, b"\0") + struct.pack("@HH", level, level)).ljust(_EFFECT_BYTES, b"\0")
        fcntl.ioctl(self.fd, _request(_WRITE, 0x80, _EFFECT_BYTES), effect)
        return int(struct.unpack_from("@Hh", effect)[1])

    def play(self, effect: int, on: bool) -> None:
        """Begin or end an effect. Raises `OSError`."""
        os.write(self.fd, EVENT.pack(0, 0, EV_FF, effect, int(on)))

    def erase(self, effect: int) -> None:
        """Take an effect away. Raises `OSError`."""
        fcntl.ioctl(self.fd, _request(_WRITE, 0x81, struct.calcsize("@i")), effect)

    def close(self) -> None:
        """Close it; may be called twice."""
        fd, self.fd = self.fd, -1
        if fd >= 0:
            with contextlib.suppress(OSError):
                os.close(fd)
