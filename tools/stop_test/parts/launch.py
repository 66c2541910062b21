"""Starts a process under test: whose commands are noted, whose time of day may be shifted, which may be a mutant.

python -m lira.tools.stop_test.parts.launch [--note JOURNAL WHO] [--mutant NAME] [--shifted] MODULE WORDS...
"""

import argparse
import runpy
import select
import sys
import time
from pathlib import Path
from typing import SupportsIndex


def sleep(seconds: float | SupportsIndex) -> None:
    """Sleep without asking for the time: libfaketime refuses to sleep until a moment on the monotonic clock."""
    select.select([], [], [], max(float(seconds), 0.0))


def main() -> None:
    """Prepare the process, and run the module in it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--note", nargs=2)
    parser.add_argument("--mutant")
    parser.add_argument("--shifted", action="store_true")
    parser.add_argument("module")
    parser.add_argument("words", nargs=argparse.REMAINDER)
    args = parser.parse_args()
    if args.shifted:
        time.sleep = sleep
    if args.note is not None:
        from lira.tools.stop_test.parts.sender import note_commands

        note_commands(Path(args.note[0]), args.note[1])
    if args.mutant is not None:
        from lira.tools.stop_test.mutants import break_product

        break_product(args.mutant)
    sys.argv = [args.module, *args.words]
    runpy.run_module(args.module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
