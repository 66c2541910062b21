"""Repeat an experiment of the thesis on the twin, in process, and print its tables beside the thesis's.

Trials of one seed share the layout and the teacher's faults, whatever the method. Each trial that ends is kept in the
folder: run the same command again to go on, or with more seeds to add to it. A run that did not converge within its
laps is counted as censored, with the labels it had used by then.

examples:
  lira experiment table2 --seeds 10 --workers 2
  lira experiment race --seeds 10 --workers 2 --json race.json
  lira experiment tableC1
"""

import argparse
import json
from pathlib import Path

from hal.errors import ConfigError
from tools.experiments.registry import REGISTRY


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    names = "; ".join(f"{name}: {entry.words}" for name, entry in REGISTRY.items())
    add = parser.add_argument
    add("name", choices=REGISTRY, metavar="NAME", help=names)
    add("--seeds", type=int, default=3, help="repetitions, seeds 0, 1, 2, ... (default: %(default)s)")
    add("--workers", type=int, default=1, help="processes side by side (default: %(default)s)")
    add("--scheduler", metavar="ADDRESS", help="run on this Dask cluster instead, like tcp://192.168.1.5:8786")
    add("--run", type=Path, metavar="DIR", help="folder that keeps the trials (default: runs/experiments)")
    add("--json", metavar="FILE", help="write a JSON object to FILE (-: standard output)")


def run(args: argparse.Namespace) -> int:
    """Run the trials that are missing and print the tables."""
    from tools.experiments.pools import Cluster, Here
    from tools.experiments.registry import load
    from tools.experiments.runner import run_trials
    from tools.verbs.bench import table, take_stdout, write_file

    if args.seeds < 1 or args.workers < 1:
        raise ConfigError("--seeds and --workers are at least 1", "Give a positive number.")
    experiment = load(args.name)
    output = take_stdout() if args.json == "-" else None
    pool = Here(args.workers) if args.scheduler is None else Cluster(args.scheduler)
    outcomes = run_trials(experiment.trials(args.seeds), args.run or Path("runs") / "experiments", pool)
    tables = experiment.tables(outcomes)
    if args.json is not None:
        report = {"name": args.name, "results": tables[0].rows, "ratios": experiment.ratios(outcomes)}
        text = json.dumps(report, indent=2)
        if output is not None:
            print(text, file=output, flush=True)
            return 0
        write_file(Path(args.json), text)
    for each in tables:
        print(f"\n{each.title}\n{table(each.rows)}")
        if each.note:
            print(each.note)
    return 0
