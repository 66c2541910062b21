"""What is up: each process and for how long, how often and how lately each topic came, the link, and who drives.

examples:
  lira status
  lira status --name second
  lira status --json                 an object for a machine; times are ages in seconds

exit status: 0 if all of it runs and the robot is heard, 1 if not
"""

import argparse
import json
import time

from lira.hal.bus.endpoint import DEFAULT_ROBOT


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--name", help=f"the robot's name on the bus (default: the one that is up, else {DEFAULT_ROBOT})")
    add("--json", action="store_true", help="print an object for a machine")


def run(args: argparse.Namespace) -> int:
    """Tell what is up."""
    from lira.tools.lifecycle.folder import meant, names
    from lira.tools.lifecycle.watch.status import as_object, as_text, look

    name = meant(args.name)
    status = look(name, time.monotonic())
    if args.json:
        print(json.dumps(as_object(status), indent=2, allow_nan=False))
    else:
        print(as_text(status))
        if others := [other for other in names() if other != name]:
            print(f"\nalso up: {', '.join(others)} (lira status --name NAME)")
    return 0 if status.is_well else 1
