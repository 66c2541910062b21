"""The guard's process, a script that needs the standard library alone: `watchdog_process.py LINE EAR STOP_FRAME`.

LINE and EAR are open descriptors, the frame is in hexadecimal. As long as bytes come on EAR it does nothing. If they
stop, or EAR is closed, it sends the frame a few times, and says so; when EAR is closed it ends. It cannot hear what is
on the line, which later may be a board that has begun anew: so it says no more until it has heard its driver again.
"""

import contextlib
import os
import select
import sys
import time

SILENCE_S = 0.2  # four commands of the driver
AGAIN_S = 0.05
STRIKES = 6  # one may be lost behind half a frame of the driver's
FAREWELL = 3
STRUCK = b"!"
READ_SIZE = 4096


def watch(line: int, ear: int, stop_frame: bytes) -> None:
    """Watch until the ear is closed."""
    left, struck = STRIKES, False
    while True:
        ready, _, _ = select.select([ear], [], [], (AGAIN_S if left else None) if struck else SILENCE_S)
        if ready:
            if not hear(ear):
                break
            left, struck = STRIKES, False
            continue
        if not struck:
            struck = True
            send(ear, STRUCK)
        send(line, stop_frame)
        left -= 1
    for _ in range(min(left, FAREWELL)):
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
