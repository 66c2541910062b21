"""The guard's process, a script that needs the standard library alone: `watchman.py LINE EAR STOP_FRAME`.

LINE and EAR are open descriptors, the frame is in hexadecimal. As long as bytes come on EAR it does nothing. If they
stop it sends the frame until they come again, and says so; if EAR is closed it sends the frame and ends.
"""

import contextlib
import os
import select
import sys
import time

SILENCE_S = 0.2  # four commands of the driver
AGAIN_S = 0.05
ENOUGH_S = 2.0  # the firmware's watchdog has struck by then; what is on the line now may be another board
FAREWELL = 3  # one may be lost behind half a frame of the driver's
STRUCK = b"!"
READ_SIZE = 4096


def watch(line: int, ear: int, stop_frame: bytes) -> None:
    """Watch until the ear is closed."""
    heard_s = struck_s = time.monotonic()
    struck = False
    while True:
        ready, _, _ = select.select([ear], [], [], AGAIN_S if struck else SILENCE_S)
        now_s = time.monotonic()
        if ready:
            if not hear(ear):
                break
            heard_s, struck = now_s, False
        elif not struck and now_s - heard_s >= SILENCE_S:
            struck, struck_s = True, now_s
            send(ear, STRUCK)
        if struck and now_s - struck_s < ENOUGH_S:
            send(line, stop_frame)
    for _ in range(FAREWELL):
        send(line, stop_frame)
        time.sleep(AGAIN_S / 5)


def hear(ear: int) -> bytes:
    """Return what came; nothing if the other end is closed, or died."""
    try:
        return os.read(ear, READ_SIZE)
    except OSError:
        return b""


def send(there: int, data: bytes) -> None:
    """Write, if anybody is there and takes it."""
    with contextlib.suppress(OSError):
        os.write(there, data)


if __name__ == "__main__":
    watch(int(sys.argv[1]), int(sys.argv[2]), bytes.fromhex(sys.argv[3]))
