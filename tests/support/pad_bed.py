"""A PS3 pad that is not there: umockdev's nodes and ioctls, and real evdev events written by the test."""

import contextlib
import ctypes
import fcntl
import os
import struct
import sys
import termios
import threading
import time
from pathlib import Path

from lira.tools.joystick.pads.codes import AXES, BUTTONS, EV_ABS, EV_KEY
from lira.tools.joystick.pads.mapping import load_mapping

PS3 = load_mapping("ps3")
PAD_KEYS = sorted(BUTTONS[name] for name in PS3.buttons)
PAD_AXES = (0, 1, 2, 3, 4, 5)
HAT = (16, 17)
SONY = "Sony PLAYSTATION(R)3 Controller"
PS3_IDS = 0x054C, 0x0268
ADDRESS = "00:11:22:33:44:55"
# Mostly dense, with pauses: from these the bridge learns a patience that outlasts a test machine's own stalls.
MOTION_S, PAUSE_S, PAUSE_EVERY = 0.005, 0.08, 10
FULL_BYTES = 1000  # a node that nobody reads takes no more
EVENT = struct.Struct("@llHHi")


def library():
    """The library, or None where the Debian package `umockdev` is not installed."""
    with contextlib.suppress(OSError):
        lib = ctypes.CDLL("libumockdev.so.0")
        lib.umockdev_testbed_new.restype = ctypes.c_void_p
        lib.umockdev_testbed_get_root_dir.restype = ctypes.c_char_p
        lib.umockdev_testbed_get_root_dir.argtypes = [ctypes.c_void_p]
        lib.umockdev_testbed_add_from_string.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
        lib.umockdev_testbed_load_ioctl.argtypes = [ctypes.c_void_p] + [ctypes.c_char_p] * 2 + [ctypes.c_void_p]
        lib.umockdev_testbed_get_dev_fd.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
        lib.umockdev_testbed_remove_device.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
        return lib
    return None


class Bed:
    """A /dev and a /sys of their own for the programs that are started with `environment`."""

    def __init__(self, folder: Path) -> None:
        self._lib = library()
        self._folder = folder
        self._bed = self._lib.umockdev_testbed_new()
        self.root = Path(self._lib.umockdev_testbed_get_root_dir(self._bed).decode())
        self._fds: dict[int, int] = {}
        self._ears: dict[int, int] = {}  # the other ends, to know what has not been read
        self._chatty: set[int] = set()
        self._lock = threading.Lock()
        self._end = threading.Event()
        self._talker = threading.Thread(target=self._talk)
        self._talker.start()

    @property
    def environment(self) -> list[str]:
        # The nodes are terminals underneath, and one that goes away hangs up on a session's leader.
        deaf = ["sh", "-c", 'trap "" HUP; exec "$@"', "sh"]
        state = f"XDG_STATE_HOME={self._folder}/state"
        return [*deaf, "env", state, "LD_PRELOAD=libumockdev-preload.so.0", f"UMOCKDEV_DIR={self.root}"]

    def close(self) -> None:
        self._end.set()
        self._talker.join()
        for number in list(self._fds):
            self.unplug(number)
        ctypes.CDLL("libgobject-2.0.so.0").g_object_unref(ctypes.c_void_p(self._bed))
        ctypes.CDLL(None).unsetenv(b"UMOCKDEV_DIR")

    def plug(self, number, name=SONY, *, uniq=ADDRESS, keys=PAD_KEYS, axes=PAD_AXES, motion=False, ids=PS3_IDS) -> None:
        """A node appears. umockdev takes each number once."""
        axes = PAD_AXES[:3] if motion else axes
        keys = [] if motion else keys
        self._lib.umockdev_testbed_add_from_string(
            self._bed, description(number, name, uniq, keys, axes, motion, ids).encode(), None
        )
        table = self._folder / f"event{number}.ioctl"
        table.write_text(ioctls(number, name, uniq, keys, axes, motion, ids))
        assert self._lib.umockdev_testbed_load_ioctl(self._bed, None, str(table).encode(), None)
        fd = self._lib.umockdev_testbed_get_dev_fd(self._bed, f"/dev/input/event{number}".encode())
        assert fd >= 0
        self._fds[number] = fd
        self._ears[number] = os.open(self.root / f"dev/input/event{number}", os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        if motion:
            self._chatty.add(number)

    def unplug(self, number: int) -> None:
        """A node goes away."""
        with self._lock:
            self._chatty.discard(number)
            os.close(self._fds.pop(number))
            os.close(self._ears.pop(number))
        for path in (
            f"/sys/devices/virtual/input/input{number}/event{number}",
            f"/sys/devices/virtual/input/input{number}",
        ):
            self._lib.umockdev_testbed_remove_device(self._bed, path.encode())
        (self.root / f"dev/input/event{number}").unlink()

    def freeze(self, number: int) -> None:
        """The motion sensors say nothing any more."""
        self._chatty.discard(number)

    def thaw(self, number: int) -> None:
        self._chatty.add(number)

    def forbid(self, number: int, mode: int) -> None:
        (self.root / f"dev/input/event{number}").chmod(mode)

    def key(self, number: int, name: str, value: int) -> None:
        self._write(number, (EV_KEY, BUTTONS[name], value))

    def axis(self, number: int, name: str, value: int) -> None:
        self._write(number, (EV_ABS, AXES[name], value))

    def _write(self, number: int, *events: tuple[int, int, int]) -> None:
        sec, ns = divmod(time.time_ns(), 10**9)
        data = b"".join(EVENT.pack(sec, ns // 1000, *event) for event in (*events, (0, 0, 0)))
        os.write(self._fds[number], data)

    def _unread(self, number: int) -> int:
        return int.from_bytes(fcntl.ioctl(self._ears[number], termios.FIONREAD, bytes(4)), sys.byteorder)

    def _talk(self) -> None:
        value = 0
        while not self._end.wait(MOTION_S if value else PAUSE_S):
            value = (value + 1) % PAUSE_EVERY
            with self._lock:
                for number in tuple(self._chatty):
                    if self._unread(number) < FULL_BYTES:
                        self._write(number, (EV_ABS, 0, 500 + value))


def description(number, name, uniq, keys, axes, motion, ids) -> str:
    node = f"/devices/virtual/input/input{number}"
    attributes = {
        "name": name, "uniq": uniq, "phys": "", "properties": "40" if motion else "0",
        "id/bustype": "0005", "id/vendor": f"{ids[0]:04x}", "id/product": f"{ids[1]:04x}", "id/version": "8100",
        "capabilities/key": bitmap(keys), "capabilities/abs": bitmap(axes),
    }  # fmt: skip
    lines = "".join(f"A: {key}={value}\\n\n" for key, value in attributes.items())
    return (
        f"P: {node}\nE: SUBSYSTEM=input\n{lines}\n"
        f"P: {node}/event{number}\nN: input/event{number}\nE: DEVNAME=/dev/input/event{number}\n"
        f"E: MAJOR=13\nE: MINOR={64 + number}\nE: SUBSYSTEM=input\nL: device=..\n\n"
    )


def ioctls(number, name, uniq, keys, axes, motion, ids) -> str:
    kinds = [0, EV_ABS] if motion else [0, EV_KEY, EV_ABS]
    lines = [
        f"@DEV /dev/input/event{number}",
        "EVIOCGVERSION 0 01000100",
        f"EVIOCGID 0 {struct.pack('<4H', 5, *ids, 0x8100).hex()}",
        f"EVIOCGNAME(0) 0 {name.encode().ljust(256, bytes(1)).hex()}",
        f"EVIOCGUNIQ(0) 0 {uniq.encode().ljust(256, bytes(1)).hex()}",
        f"EVIOCGBIT(0) 0 {bits(kinds, 4)}",
        f"EVIOCGBIT(1) 0 {bits(keys, 96)}",
        f"EVIOCGBIT(3) 0 {bits(axes, 96)}",
        f"EVIOCGBIT(21) 0 {bits([], 96)}",
        f"EVIOCGPROP(0) 0 {bits([6] if motion else [], 4)}",
        f"EVIOCGKEY(0) 0 {bits([], 96)}",
        "EVIOCGEFFECTS 0 00000000",
    ]
    for axis in axes:
        least, most = (-1, 1) if axis in HAT else (0, 255)
        value = 0 if axis in (*HAT, 2, 5) else 128
        lines.append(f"EVIOCGABS({axis}) 0 {struct.pack('<6i', value, least, most, 0, 0, 0).hex()}")
    return "\n".join(lines).upper().replace("@DEV /DEV/INPUT/EVENT", "@DEV /dev/input/event") + "\n"


def bitmap(codes) -> str:
    """As in /sys/class/input/*/device/capabilities."""
    words = [0] * (max(codes, default=0) // 64 + 1)
    for code in codes:
        words[code // 64] |= 1 << code % 64
    return " ".join(f"{word:x}" for word in reversed(words))


def bits(codes, size: int) -> str:
    data = bytearray(size)
    for code in codes:
        data[code // 8] |= 1 << code % 8
    return bytes(data).hex()
