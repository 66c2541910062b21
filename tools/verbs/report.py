"""Make the HTML page of a recorded run, from the run.jsonl in its folder.

examples:
  lira report runs/demo-20250131-101500     make (or make again) report.html in that folder
"""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("run", type=Path, metavar="RUN_DIR", help="folder of the run, or its run.jsonl")


def run(args: argparse.Namespace) -> int:
    """Write the page and print its path."""
    from lira.tools.report import RECORD, write_report

    folder = args.run.parent if args.run.name == RECORD else args.run
    print(write_report(folder))
    return 0
