"""A byte line to a device: a serial port by its path, or one behind a socket by its URL. Every read has a timeout."""

import contextlib
import os
import select
import termios
from pathlib import Path

import serial

from lira.hal.errors import DeviceError
from lira.robot.port_users import other_users

READ_SIZE = 4096
FLUSHES = 64
BITS = 10  # of a byte on the line
WRITE_TIMEOUT_S = 0.2
# What pyserial lets through, besides its own, from the system and its own arithmetic.
FAULTS = (serial.SerialException, OSError, ValueError, TypeError, OverflowError, termios.error)


class Line:
    """An open line. Raises `DeviceError` with the remedy when the device is missing, taken or lost.

    `url` is a device's path, or whatever pyserial understands, such as `socket://rosbot:4001`.
    """

    def __init__(self, url: str, baud: int) -> None:
        self.url = url
        try:
            self._port = serial.serial_for_url(url, do_not_open=True)
            self._port.baudrate = baud
            self._port.timeout = 0
            self._port.write_timeout = WRITE_TIMEOUT_S
            self._port.exclusive = True
            self._port.dtr = False  # high stops the lidar's motor
            self._port.open()
        except FAULTS as error:
            raise _why_not(url, error) from error
        self.has_baud = "://" not in url
        self.baud = baud
        users = other_users(url) if self.has_baud else []
        if users:
            self.close()
            raise DeviceError(f"{url} is in use by {', '.join(users)}", "Stop that program first.")

    def fileno(self) -> int:
        """Its descriptor, for another process to share. Raises `DeviceError` for a line that has none."""
        try:
            return int(self._port.fileno())
        except FAULTS as error:
            raise self._lost(error) from error

    def set_baud(self, baud: int) -> None:
        """Change the speed. Raises `DeviceError` if the port cannot."""
        try:
            self._port.baudrate = self.baud = baud
        except FAULTS as error:
            raise DeviceError(f"{self.url} cannot do {baud} baud: {error}", "Use another serial adapter.") from error

    @property
    def byte_s(self) -> float:
        """How long a byte takes; 0 where that is not known."""
        return BITS / self.baud if self.has_baud else 0.0

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, at once if there is any; nothing after `timeout_s`."""
        try:
            number = self._port.fileno()
            ready, _, _ = select.select([number], [], [], timeout_s)
            if not ready:
                return b""
            data = os.read(number, READ_SIZE)
        except FAULTS as error:
            raise self._lost(error) from error
        if not data:
            raise self._lost("the other side closed it")
        return data

    def write(self, data: bytes) -> None:
        """Send all of it."""
        try:
            self._port.write(data)
        except FAULTS as error:
            raise self._lost(error) from error

    def flush_input(self) -> None:
        """Forget what has come and was not read; what comes without end meanwhile is left."""
        for _ in range(FLUSHES):
            if not self.read(0.0):
                break

    def close(self) -> None:
        """Let go of it. May be called twice."""
        left = getattr(self._port, "_socket", None)  # pyserial forgets to close it when the other side has gone
        with contextlib.suppress(*FAULTS):
            self._port.close()
        with contextlib.suppress(*FAULTS):
            if left is not None:
                left.close()

    def _lost(self, why: object) -> DeviceError:
        return DeviceError(f"{self.url} was lost: {why}", "Check plug and power; it is opened again when it is back.")


def _why_not(url: str, error: Exception) -> DeviceError:
    if "://" in url:
        return DeviceError(f"{url} does not open: {error}", "Is the serial server running, and the address right?")
    if not Path(url).exists():
        return DeviceError(f"there is no {url}", "Plug the device in, or give its path; see /dev/serial/by-id.")
    if isinstance(error, PermissionError) or "ermission denied" in str(error):
        return DeviceError(f"{url} may not be opened", "Add the user to the group that owns it (often dialout).")
    if "lock" in str(error):
        return DeviceError(f"{url} is in use by another program", "Stop that one first.")
    return DeviceError(f"{url} does not open: {error}", "Is it a serial port?")
