"""The supervisor's process: python -m lira.tools.lifecycle SET-UP, which `lira up` starts, with the set-up as JSON."""

import sys
import time

import msgspec

from lira.hal.errors import LiraError
from lira.tools.launch.lifetime import process
from lira.tools.lifecycle.control import supervise
from lira.tools.lifecycle.setup import Setup


def say(words: str) -> None:
    """Note something in the log, with the time of day."""
    print(f"{time.strftime('%F %T')} {words}", flush=True)


def main(text: str) -> int:
    """Supervise until told to stop."""
    try:
        supervise(msgspec.json.decode(text, type=Setup), say)
    except LiraError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    process(lambda: main(sys.argv[1]))
