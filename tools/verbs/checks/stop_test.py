"""Break things while a robot drives, and measure how soon it stands.

A robot is served in real time by its own process, and driven over a relay that can fail like a bad link: by
`lira fusion`, by the bridge of `lira joystick`, or by a driver that goes wrong when told to. Each row says how long
after the last command that was obeyed the wheels had zero, how far the robot went, how many stale commands it obeyed,
and whether it moved without being asked by somebody who may. All of that comes from the senders' own logs and from what
the wheels were given, not from what the robot says. `fault_to_zero_s` counts from the fault, `asked` is how often
motion was asked for once all was mended, `stopped_by` what the robot noted. The exit status is 1 if any row fails.

With --mutants the product is broken on purpose, in one known way after the other, and the rows meant for each have to
fail; the same rows have to pass without it. The exit status is 1 if one gets through.

examples:
  lira stop-test                        the whole matrix, less than fifteen minutes
  lira stop-test --quick                a part of it, once each, in a minute and a half
  lira stop-test --only lidar           the rows with that word in their name
  lira stop-test --mutants              whether the rows would notice
  lira stop-test --json -               one JSON object on standard output
"""

import argparse
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from lira.hal.errors import ConfigError
from lira.tools.options import add_json, add_profile, add_seed

TIMES = ("fault", "n", "p50_s", "p99_s", "max_time_to_zero_s", "budget_s", "fault_to_zero_s", "distance_m")
COLUMNS = (*TIMES, "stale_obeyed", "moved_unasked", "asked", "refused", "stopped_by", "passed")
MUTANT_COLUMNS = ("mutant", "rows", "caught", "why")
Cells = Mapping[str, str | float | int | bool]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--quick", action="store_true", help="the most telling rows, once each")
    what.add_argument("--mutants", action="store_true", help="break the product on purpose: do the rows notice?")
    add("--only", metavar="WORD", default="", help="only the rows (or mutants) with this word in their name")
    add("--trials", type=int, metavar="N", help="how often each (default: as the row says; with --quick 1)")
    add_profile(parser, "rosbot2")
    add_seed(parser, "when in the control period a fault comes")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run the matrix, or the mutants."""
    from lira.hal.profile import load_profile
    from lira.tools.bench import describe_machine
    from lira.tools.output.machine import output_for, tell

    load_profile(args.profile)  # said here rather than by each process that is given it
    output = output_for(args.json)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # whatever ends this ends all that it has started
    with TemporaryDirectory() as folder:
        results = try_mutants(args, Path(folder)) if args.mutants else try_rows(args, Path(folder))
    passed = all(result["caught" if args.mutants else "passed"] for result in results)
    found = {"name": "stop-test", "passed": passed, "machine": describe_machine(), "results": results}
    tell(args.json, output, found, as_table(MUTANT_COLUMNS if args.mutants else COLUMNS, results))
    return 0 if passed else 1


def try_rows(args: argparse.Namespace, folder: Path) -> Sequence[Cells]:
    """Try what was asked for."""
    from lira.tools.stop_test.matrix import Matrix, missing
    from lira.tools.stop_test.rows import ROWS

    rows = [row for row in ROWS if (row.quick or not args.quick) and args.only in row.name]
    if not rows:
        raise ConfigError(f"no row is called '{args.only}'", f"There are: {'; '.join(row.name for row in ROWS)}.")
    for row in rows:
        if lack := missing(row):
            print(f"skip {row.name}: needs {lack}", file=sys.stderr, flush=True)
    trials = args.trials or (1 if args.quick else None)
    rows = [row for row in rows if not missing(row)]
    return list(Matrix(folder, args.profile, args.seed).run(rows, trials, say_row))


def try_mutants(args: argparse.Namespace, folder: Path) -> Sequence[Cells]:
    """Break the product in every known way."""
    from lira.tools.stop_test.cull import cull
    from lira.tools.stop_test.mutants import MUTANTS

    mutants = [mutant for mutant in MUTANTS if args.only in mutant.name]
    if not mutants:
        known = "; ".join(mutant.name for mutant in MUTANTS)
        raise ConfigError(f"no mutant is called '{args.only}'", f"There are: {known}.")
    return cull(mutants, folder, args.profile, args.seed, say_row, say_mutant)


def say_row(row: Cells) -> None:
    """Tell how a row went, at once."""
    how = row.get("error") or f"{row['max_time_to_zero_s']:.3f} s, {row['stopped_by']}"
    say(f"{'ok  ' if row['passed'] else 'FAIL'} {row['fault']}: {how}")


def say_mutant(mutant: Cells) -> None:
    """Tell whether a mutant was noticed."""
    say(f"{'caught ' if mutant['caught'] else 'MISSED '} {mutant['mutant']}: {mutant['why']}")


def say(line: str) -> None:
    """Print to standard error."""
    print(line, file=sys.stderr, flush=True)


def as_table(columns: Sequence[str], results: Sequence[Cells]) -> str:
    """Results for a person."""
    from lira.tools.bench import cell
    from lira.tools.output.table import format_table

    return format_table(columns, [[cell(result[name]) for name in columns] for result in results])
