"""Runs a module whose time of day libfaketime shifts, and goes around what that library gets wrong.

It refuses to sleep until a moment on the monotonic clock, as Python does.

python -m tools.stop_test.shifted MODULE WORDS...
"""

import runpy
import select
import sys
import time
from typing import SupportsIndex


def sleep(seconds: float | SupportsIndex) -> None:
    """Sleep without asking for the time."""
    select.select([], [], [], max(float(seconds), 0.0))


if __name__ == "__main__":
    time.sleep = sleep
    sys.argv = sys.argv[1:]
    runpy.run_module(sys.argv[0], run_name="__main__")
