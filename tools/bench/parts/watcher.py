"""A console without a window: looks at everything on the bus as often as `lira console` draws.

python -m lira.tools.bench.parts.watcher NAME HOST:PORT
"""

import sys
import time

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import ask_info
from lira.tools.operator.listen import Ears

READY = "watching"
LOOK_S = 0.05


def main(name: str, endpoint: str) -> None:
    """Look for ever."""
    watch = Bus(name, connect=endpoint, watch=True)
    ears = Ears(watch, ask_info(watch))
    print(READY, flush=True)
    while True:
        ears.look()
        time.sleep(LOOK_S)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
