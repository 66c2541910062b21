"""Make the HTML page of a recorded run, from the run.jsonl in its folder; of two runs, a page that compares them.

examples:
  lira report runs/demo-20250131-101500     make (or make again) report.html in that folder
  lira report runs/monday runs/tuesday      both side by side, in runs/monday/comparison.html
"""

import argparse
from pathlib import Path

from lira.hal.errors import ConfigError
from lira.hal.words import plural


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("run", type=Path, nargs="+", metavar="RUN_DIR", help="folder of a run or its run.jsonl; or two")
    parser.add_argument("--to", type=Path, metavar="FILE", help="where a page on two runs is written")


def run(args: argparse.Namespace) -> int:
    """Write the page and print its path."""
    from lira.tools.report import COMPARISON, write_comparison, write_report
    from lira.tools.runs.names import RECORD

    folders = [path.parent if path.name == RECORD else path for path in args.run]
    match folders:
        case [one]:
            if args.to is not None:
                raise ConfigError("--to is for a page on two runs", "The page of one is report.html in its folder.")
            print(write_report(one))
        case [one, other]:
            print(write_comparison((one, other), args.to or one / COMPARISON))
        case _:
            raise ConfigError(f"{plural(len(folders), 'run')} do not fit beside each other", "Name one or two.")
    return 0
