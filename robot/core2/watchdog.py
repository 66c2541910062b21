"""A second process on the base's line, which sends zero when the first stops saying that it lives.

What stops a process stops all of its threads: kill -9, a debugger, a full swap, a library that holds the interpreter.
So a small process (`watchdog_process.py`) shares the open line, and hears a byte with each command. It strikes long
before the firmware's watchdog does.
"""

import contextlib
import socket
import subprocess
import sys
from pathlib import Path

from lira.hal.errors import DeviceError

SCRIPT = Path(__file__).with_name("watchdog_process.py")
ALIVE = b"."
READ_SIZE = 64


class WatchdogProcess:
    """Watches over this process while it exists. `stop_frame` is what makes the board at `line` stand.

    Raises `DeviceError` if it cannot be started.
    """

    def __init__(self, line: int, stop_frame: bytes) -> None:
        self._mouth, ear = socket.socketpair()
        self._mouth.setblocking(False)
        # A bare interpreter: it starts at once and needs 10 MB. A session of its own: Ctrl-C is not for it.
        command = [sys.executable, "-I", "-S", str(SCRIPT), str(line), str(ear.fileno()), stop_frame.hex()]
        try:
            self._process = subprocess.Popen(command, pass_fds=(line, ear.fileno()), start_new_session=True)
        except OSError as error:
            self._mouth.close()
            raise DeviceError(f"the guard of the base does not start: {error}", "Free some memory.") from error
        finally:
            ear.close()

    def tell(self) -> bool:
        """Say that this process lives. Returns whether the guard has stopped the wheels since the last time.

        Raises `DeviceError` if it is gone: nobody drives unguarded.
        """
        try:
            with contextlib.suppress(BlockingIOError):  # it was told often enough and has no time to hear it
                self._mouth.send(ALIVE)
            heard = self._mouth.recv(READ_SIZE)
        except BlockingIOError:
            return False
        except OSError:
            heard = b""
        if not heard:
            raise DeviceError("the guard of the base has died", "It is started again.")
        return True

    def close(self) -> None:
        """End it without another word on the line. May be called twice."""
        self._process.kill()
        self._process.wait()
        self._mouth.close()
