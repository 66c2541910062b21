"""Break things while a robot drives, and measure how soon it stands.

A twin is served in real time by its own process, and driven over a relay that can fail like a bad link: by
`lira fusion`, by the bridge of `lira joystick`, or by a driver that goes wrong by word. Some faults are tried on the
physical robot's drivers, on a bus with keys, or with clocks that are set. Each row says how long after the last valid
command the wheels had zero, how far the robot went, how many stale commands it obeyed, and whether it moved again
unasked. `fault_to_zero_s` counts from the fault instead, where a commander is first stopped dead 0.3 s after it
if the fault alone is to change nothing. `stopped_by` is what the robot noted. The exit status is 1 if any row fails.

examples:
  lira stop-test                        the whole matrix, about ten minutes
  lira stop-test --quick                a part of it, once each, in a minute or two
  lira stop-test --only lidar           the rows with that word in their name
  lira stop-test --json -               one JSON object on standard output
"""

import argparse
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from hal.errors import ConfigError

TIMES = ("fault", "n", "p50_s", "p99_s", "max_time_to_zero_s", "fault_to_zero_s", "distance_m")
COLUMNS = (*TIMES, "stale_obeyed", "moved_unasked", "refused", "stopped_by", "passed")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--quick", action="store_true", help="the most telling faults, once each")
    add("--only", metavar="WORD", help="only the faults with this word in their name")
    add("--trials", type=int, metavar="N", help="how often each (default: 3, with --quick 1)")
    add("--profile", default="rosbot2", help="robot by name or .toml file (default: %(default)s)")
    add("--seed", type=int, default=0, help="when in the control period a fault comes (default: %(default)s)")
    add("--json", metavar="FILE", help="write a JSON object to FILE (-: standard output)")


def run(args: argparse.Namespace) -> int:
    """Run the matrix."""
    from tools.bench import cell, describe_machine
    from tools.stop_test.faults import FAULTS
    from tools.stop_test.matrix import missing, run_matrix
    from tools.table import format_table
    from tools.verbs.bench import take_stdout, write_file

    faults = tuple(fault for fault in FAULTS if (fault.quick or not args.quick) and (args.only or "") in fault.name)
    if not faults:
        raise ConfigError(f"no fault is called '{args.only}'", f"There are: {'; '.join(f.name for f in FAULTS)}.")
    trials = args.trials or (1 if args.quick else 3)
    output = take_stdout() if args.json == "-" else sys.stdout
    for fault in faults:
        if lack := missing(fault):
            print(f"skip {fault.name}: needs {lack}", file=sys.stderr, flush=True)
    faults = tuple(fault for fault in faults if not missing(fault))
    with TemporaryDirectory() as folder:

        def say(row: dict[str, str | float | int | bool]) -> None:
            mark = "ok  " if row["passed"] else "FAIL"
            how = f"{row['max_time_to_zero_s']:.3f} s, {row['stopped_by']}"
            print(f"{mark} {row['fault']}: {how}", file=sys.stderr, flush=True)

        rows = run_matrix(faults, Path(folder), args.profile, trials, args.seed, say)
    passed = all(row["passed"] for row in rows)
    if args.json is not None:
        answer = {"name": "stop-test", "passed": passed, "machine": describe_machine(), "results": rows}
        text = json.dumps(answer, indent=2)
        if args.json == "-":
            print(text, file=output, flush=True)
        else:
            write_file(Path(args.json), text)
    if args.json != "-":
        print(format_table(COLUMNS, [[cell(row[name]) for name in COLUMNS] for row in rows]), file=output)
    return 0 if passed else 1
