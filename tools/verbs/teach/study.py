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
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.tools.options import natural

if TYPE_CHECKING:
    from lira.tools.study.plan import StudyPlan
    from lira.tools.study.questions import Answered

DRY = 3  # participants of a dry run


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
    import torch

    from lira.fusion.inference.threads import one_thread
    from lira.tools.study.plan import load_plan

    torch.set_num_threads(1)
    one_thread()
    plan = load_plan(args.plan)
    folder: Path = args.to or Path("runs") / f"study-{args.plan.stem}{'-dry' if args.dry_run else ''}"
    if args.dry_run:
        dry_run(plan, folder)
    elif args.participant is not None:
        if not 1 <= args.participant <= plan.participants:
            raise ConfigError(f"there is no participant {args.participant}", f"The plan has 1 to {plan.participants}.")
        if not hold_next(args, plan, folder):
            return 1
    conclude(plan, folder)
    return 0


def dry_run(plan: "StudyPlan", folder: Path) -> None:
    """Everything with scripts in the place of people."""
    from lira.tools.study import script
    from lira.tools.study.order import blinded, order

    if (folder / "blocks.csv").exists():
        raise ConfigError(f"{folder} already holds a study", "Choose another folder with --to.")
    for participant in range(1, DRY + 1):
        names = blinded(plan.methods, participant, plan.seed)
        for place, method in enumerate(order(plan.methods, participant), start=1):
            block = block_folder(folder, participant, place)
            script.teach_block(plan, method, participant, block)
            add_row(
                folder,
                block,
                participant,
                place,
                method,
                names[method],
                script.answer(participant, place, plan.questions),
            )
            print(
                f"participant {participant} ({script.skill_of(participant)}), block {place}: {names[method]}",
                flush=True,
            )


def hold_next(args: argparse.Namespace, plan: "StudyPlan", folder: Path) -> bool:
    """Hold the first block that a participant has not done. Returns False without consent."""
    from lira.tools.cli import main
    from lira.tools.study.order import blinded, order
    from lira.tools.study.questions import ask_all
    from lira.tools.study.table import TABLE, read_rows

    number = args.participant
    done = sum(row.participant == name_of(number) for row in read_rows(folder / TABLE))
    methods = order(plan.methods, number)
    if done >= len(methods):
        raise ConfigError(f"participant {number} has done every block", "See --analyse.")
    if done == 0:
        print(f"{plan.title}\n\n{plan.consent}\n")
        if input("Do you agree to take part? yes or no: ").strip().lower() not in ("y", "yes"):
            return False
    method, place = methods[done], done + 1
    shown = blinded(plan.methods, number, plan.seed)[method]
    block = block_folder(folder, number, place)
    print(f"block {place} of {len(methods)}: method {shown}", flush=True)
    words = ["--as", name_of(number), "--method", method, "--world", plan.world, "--layout", str(plan.layout)]
    words += ["--practice", str(plan.practice_s), "--unseen", str(plan.unseen), "--run", str(block)]
    words += ["--speed", str(plan.speed), "--seed", str(plan.seed + number), "--minutes", str(plan.minutes)]
    words += [] if plan.until_passed else ["--whole-time"]
    words += ["--name", args.name, *(["--connect", args.connect] if args.connect else [])]
    status = main(["teach", *words])
    if status not in (0, 1):
        sys.exit(status)
    answered = ask_all(plan.questions, lambda question: input(f"{question}: "))
    add_row(folder, block, number, place, method, shown, answered)
    return True


def name_of(participant: int) -> str:
    """What a participant is called: nobody's name is written down."""
    return f"participant-{participant:03d}"


def block_folder(folder: Path, participant: int, place: int) -> Path:
    """Where a block is kept."""
    return folder / name_of(participant) / f"block-{place}"


def add_row(
    folder: Path, block: Path, participant: int, place: int, method: str, shown: str, answered: "Answered"
) -> None:
    """Write the block's report, and its row."""
    from lira.tools.report import RECORD, write_report
    from lira.tools.report.digest import load_run
    from lira.tools.study.table import TABLE, read_rows, row_of, write_rows

    write_report(block)
    row = row_of(load_run(block / RECORD), name_of(participant), place, method, shown, answered)
    write_rows(folder / TABLE, [*read_rows(folder / TABLE), row])


def conclude(plan: "StudyPlan", folder: Path) -> None:
    """Write the export and the page."""
    from lira.hal.config import write_whole
    from lira.tools.study.analysis import render
    from lira.tools.study.table import ANALYSIS, EXPORT, TABLE, export, read_rows

    rows = read_rows(folder / TABLE)
    if not rows:
        raise ConfigError(f"{folder} holds no block yet", "Begin with --participant 1, or try --dry-run.")
    export(folder / EXPORT, rows)
    write_whole(folder / ANALYSIS, render(plan.title, rows).encode())
    print(f"table: {folder / TABLE}, without names: {folder / EXPORT}, analysis: {folder / ANALYSIS}", flush=True)
