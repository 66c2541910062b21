"""A process that does nothing but sleep, and notes when it was woken late: then this machine was busy, or stood still.

python -m lira.tools.stop_test.parts.pulse JOURNAL
"""

import sys
import time
from pathlib import Path

from lira.tools.stop_test.journal import JournalWriter, Stalled

READY = "beats"
NAP_S = 0.005
LATE_S = 0.03


def main(folder: Path) -> None:
    """Beat until killed."""
    journal = JournalWriter(folder, "pulse")
    print(READY, flush=True)
    before_s = time.monotonic()
    while True:
        time.sleep(NAP_S)
        now_s = time.monotonic()
        if now_s - before_s - NAP_S > LATE_S:
            journal.note(Stalled(now_s, now_s - before_s - NAP_S))
        before_s = now_s


if __name__ == "__main__":
    main(Path(sys.argv[1]))
