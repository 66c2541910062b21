"""A page as a pad: the bridge reads it as it reads a gamepad, so it locks, gives back and stops in the same way."""

import contextlib
import socket
import time

from lira.hal.errors import DeviceError
from lira.tools.joystick.axes import PadState
from lira.tools.joystick.pads.mapping import Mapping
from lira.tools.web.seat import Client, Seat, pad_of


class PagePad:
    """Implements `tools.joystick.bridge.OpenPad` for whoever has the seat. `wake` is called when a page has spoken."""

    name, key = "a page in a browser", "page"
    has_motion, motion_trouble = False, ""

    def __init__(self, seat: Seat, mapping: Mapping, client: Client) -> None:
        self.state = PadState()
        self.mapping = mapping
        self._seat, self._client = seat, client
        self._near, self._far = socket.socketpair()
        self._near.setblocking(False)
        self._far.setblocking(False)

    def fileno_list(self) -> list[int]:
        """What to wait for."""
        return [self._near.fileno()]

    def wake(self) -> None:
        """Let the bridge look at once. May be called from any thread, also after the pad was closed."""
        with contextlib.suppress(OSError):  # it is full, so it wakes anyway; or it is closed
            self._far.send(b"\0")

    def read(self) -> tuple[list[PadState], bool]:
        """States since the last call. Raises `DeviceError` when the page is silent, hidden, gone, or another one."""
        with contextlib.suppress(BlockingIOError):
            self._near.recv(4096)
        if self._seat.holder() != self._client:
            raise DeviceError("the page has left its seat", "Press Drive on a page.")
        broken = self._seat.take_break() or not self._seat.alive(time.monotonic())
        states = [pad_of(said, self.mapping) for said in self._seat.take_said()]
        if states:
            self.state = states[-1]
        if broken:
            raise DeviceError("the page is silent or hidden", "Look at the page; it drives on when it is seen.")
        return states, bool(states)

    def rumble(self, strength: float) -> None:
        """A page shakes by itself, from what it shows."""

    def close(self) -> None:
        """Close it."""
        self._near.close()
        self._far.close()


class PageFinder:
    """Gives the bridge the page that has the seat, once it has spoken."""

    def __init__(self, seat: Seat, mapping: Mapping) -> None:
        self._seat, self._mapping = seat, mapping
        self._pad: PagePad | None = None

    def __call__(self) -> PagePad | None:
        """The page that drives, None if nobody does."""
        client = self._seat.holder()
        if client is None or not self._seat.alive(time.monotonic()):
            return None
        self._seat.take_break()
        self._pad = PagePad(self._seat, self._mapping, client)
        return self._pad

    def wake(self) -> None:
        """A page has spoken."""
        if self._pad is not None:
            self._pad.wake()
