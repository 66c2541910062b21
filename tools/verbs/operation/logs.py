"""What the processes of a robot have written, those that are up and those that were.

examples:
  lira logs                      the last lines of each
  lira logs learner -n 100       more of one
  lira logs --follow             and what they write from now on, until Ctrl-C
"""

import argparse

from lira.hal.bus.endpoint import DEFAULT_ROBOT
from lira.hal.errors import ConfigError
from lira.tools.options import DEFAULT, natural


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("process", nargs="?", help="one of them (default: all)")
    add("--name", help=f"the robot's name on the bus (default: the one that is up, else {DEFAULT_ROBOT})")
    add("-n", "--lines", type=natural, default=10, metavar="N", help=f"so many lines of each {DEFAULT}")
    add("-f", "--follow", action="store_true", help="go on with what is written from now on")


def run(args: argparse.Namespace) -> int:
    """Print them."""
    from lira.tools.lifecycle.folder import StateFolder, meant
    from lira.tools.lifecycle.logs import follow, last_lines
    from lira.tools.lifecycle.setup import command_line

    name = meant(args.name)
    folder = StateFolder(name)
    found = sorted(folder.logs.glob("*.log")) if folder.logs.is_dir() else []
    names = [log.stem for log in found]
    if not found:
        remedy = f"Start it with: {command_line('up', name)}. Of services: journalctl --user -u 'lira-{name}-*'."
        raise ConfigError(f"nothing was ever up as '{name}' here", remedy)
    if args.process is not None and args.process not in names:
        raise ConfigError(f"there is no log of '{args.process}'", f"There is one of: {', '.join(names)}.")
    logs = [log for log in found if args.process in (None, log.stem)]
    width = max(len(log.stem) for log in logs)

    def say(name: str, line: str) -> None:
        print(f"{name:<{width}} | {line}" if len(logs) > 1 else line, flush=True)

    for log in logs:
        for line in last_lines(log, args.lines):
            say(log.stem, line)
    if args.follow:
        follow(logs, say)
    return 0
