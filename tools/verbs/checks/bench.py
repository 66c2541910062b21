"""Measure speed on this machine.

examples:
  lira bench twin                       a table to read
  lira bench twin --json -              one JSON object {name, machine, results} and nothing else on standard output
  lira bench latency --json latency.json
  lira bench soak --minutes 5
  lira bench trial --seeds 10           medians over ten trials of each method
  lira bench drivers --minutes 10       how many samples the lidar's line loses in ten minutes
  lira bench twin --history bench/history   note its ratios there, and compare them with those before

exit status: 1 if something that has to stay flat did not, or a ratio is over 30 % worse than it was on this machine
"""

import argparse
import importlib
import sys
from pathlib import Path

from lira.hal.errors import ConfigError
from lira.tools.bench import BENCHES, Row, describe_machine, module_of
from lira.tools.options import add_json, positive
from lira.tools.output.machine import output_for, table, tell

LASTING = ("soak", "drivers", "record")  # those that go on for --minutes
SEEDED = ("trial",)  # those that play the trials of so many --seeds


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    names = "; ".join(f"{name}: {words}" for name, words in BENCHES.items())
    parser.add_argument("name", choices=BENCHES, metavar="NAME", help=names)
    parser.add_argument(
        "--minutes",
        type=float,
        help="how long the soak (default: 30), the line of drivers (0.25) or each half of record (1) goes on",
    )
    parser.add_argument("--seeds", type=positive, metavar="N", help="trials of each method in trial (default: 3)")
    add_json(parser)
    parser.add_argument("--history", type=Path, metavar="DIR", help="add the ratios to DIR/NAME.jsonl and compare")


def run(args: argparse.Namespace) -> int:
    """Run one benchmark and show its rows."""
    if args.minutes is not None and args.name not in LASTING:
        raise ConfigError(f"'{args.name}' takes no --minutes", f"Only {' and '.join(LASTING)} do.")
    if args.seeds is not None and args.name not in SEEDED:
        raise ConfigError(f"'{args.name}' takes no --seeds", f"Only {' and '.join(SEEDED)} does.")
    output = output_for(args.json)
    module = importlib.import_module(module_of(args.name))
    given = [value for value in (args.minutes, args.seeds) if value is not None]
    results: list[Row] = module.run(*given)
    found = {"name": args.name, "machine": describe_machine(), "results": results}
    tell(args.json, output, found, table(results))
    slower = False if args.history is None else note(args.history / f"{args.name}.jsonl", results)
    return 1 if slower or exit_status(results) else 0


def exit_status(results: list[Row]) -> int:
    """1 if a row says that something that has to stay flat did not."""
    return 1 if any(row.get("flat") is False for row in results) else 0


def note(path: Path, results: list[Row]) -> bool:
    """Add the ratios to a benchmark's history, and say on standard error which are worse than before, if any."""
    from importlib.metadata import version

    from lira.tools.output.bench_history import append, entry, read_history, worse

    before, now = read_history(path), entry(describe_machine(), version("lira-rosbot"), results)
    if not now.ratios:  # it compares with nothing
        return False
    append(path, now)
    lines = worse(now, before)
    if lines:
        print(f"worse than before: {'; '.join(lines)}", file=sys.stderr)
    return bool(lines)
