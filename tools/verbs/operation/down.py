"""Stop all that is up for a robot: whoever drives first, the robot last. What was learned is saved.

examples:
  lira down
  lira down --name second
"""

import argparse

from lira.hal.bus.endpoint import DEFAULT_ROBOT


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "--name", help=f"the robot's name on the bus (default: the one that is up, else {DEFAULT_ROBOT})"
    )


def run(args: argparse.Namespace) -> int:
    """Stop it."""
    from lira.tools.lifecycle.control import take_down
    from lira.tools.lifecycle.folder import meant
    from lira.tools.output.say import say

    name = meant(args.name)
    was_up = take_down(name, say)
    print(f"'{name}' is down" if was_up else f"nothing was up for '{name}'")
    return 0
