"""A study with people: everybody teaches by every method of a plan, in a balanced order, and is asked afterwards.

The plan is a TOML file (examples/study.toml): consent, methods, practice, time, questions. On the screen methods have
letters. Each block leaves a folder with its labels, record and report, and a row in blocks.csv; export.csv is the table
without names and free words; analysis.html compares the methods within people, with 95 % intervals.

examples:
  lira study examples/study.toml --dry-run              three scripted skills on a twin in this process: some minutes
  lira study examples/study.toml --participant 1        the next block of participant 1; again for the one after it
  lira study examples/study.toml --analyse              export and page anew, from the table as it is

exit status: 0 done; 1 if consent was not given
"""

import argparse
from pathlib import Path

from lira.tools.options import natural


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("plan", type=Path, metavar="PLAN", help="the study's .toml file")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--participant", type=natural, metavar="N", help="hold the next block of participant N, from 1")
    what.add_argument("--dry-run", action="store_true", help="scripted people of three skills, and everything else")
    what.add_argument("--analyse", action="store_true", help="write the export and the page from the table")
    add("--to", type=Path, metavar="DIR", help="the study's folder (default: runs/study-<plan's name>)")
    add("--connect", metavar="HOST:PORT", help="teach the robot that is there instead of a twin")
    add("--name", default="rosbot", help="the robot's name on the bus (default: %(default)s)")


def run(args: argparse.Namespace) -> int:
    """Hold blocks, or analyse them."""
    from lira.fusion.inference.threads import one_thread
    from lira.tools.cli import main
    from lira.tools.output.say import say
    from lira.tools.study.conduct import Study
    from lira.tools.study.plan import load_plan

    one_thread()
    folder: Path = args.to or Path("runs") / f"study-{args.plan.stem}{'-dry' if args.dry_run else ''}"
    study = Study(load_plan(args.plan), folder, say)
    if args.dry_run:
        study.dry_run()
    elif args.participant is not None:
        where = ["--name", args.name, *(["--connect", args.connect] if args.connect else [])]
        status = study.hold_next(
            args.participant, lambda words: main(["teach", *words, *where]), lambda words: input(f"{words}: ")
        )
        if status != 0:
            return status
    study.conclude()
    return 0
