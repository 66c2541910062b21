"""Repeat an experiment of the thesis on the twin, in process, and print its table beside the thesis's.

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

EXPERIMENTS = {
    "table2": "LIRA-SPF and HG-DAgger on line-obstacles (Table II)",
    "race": "the same on the 120 m race with 21 boxes (fig. 11, 12)",
    "tableC1": "activation thresholds on the figure-eight, redundancy filter off (Table C.1)",
    "tableC2": "activation and redundancy thresholds on the figure-eight (Table C.2)",
}
WORLDS = {"table2": "line-obstacles", "race": "race"}
# Table II as printed, in the columns of our summary.
THESIS_TABLE2: list[dict[str, object]] = [
    {
        "method": "thesis: LIRA-SPF",
        "n": 10,
        "buffer_first": 158,
        "human_labels_first": 50,
        "interventions_first": 7,
        "buffer": 273.5,
        "human_labels": 59,
        "interventions": 9.5,
    },
    {
        "method": "thesis: HG-DAgger",
        "n": 10,
        "buffer_first": 167,
        "human_labels_first": 96.5,
        "interventions_first": 11,
        "buffer": 228,
        "human_labels": 156.5,
        "interventions": 19.5,
    },
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    names = "; ".join(f"{name}: {words}" for name, words in EXPERIMENTS.items())
    add = parser.add_argument
    add("name", choices=EXPERIMENTS, metavar="NAME", help=names)
    add("--seeds", type=int, default=3, help="repetitions, seeds 0, 1, 2, ... (default: %(default)s)")
    add("--workers", type=int, default=1, help="processes side by side (default: %(default)s)")
    add("--run", type=Path, metavar="DIR", help="folder that keeps the trials (default: runs/experiments)")
    add("--json", metavar="FILE", help="write a JSON object to FILE (-: standard output)")


def run(args: argparse.Namespace) -> int:
    """Run the trials that are missing and print the tables."""
    from tools.experiments import compare, thresholds
    from tools.experiments.runner import run_trials
    from tools.verbs.bench import table, take_stdout, write_file

    if args.seeds < 1 or args.workers < 1:
        raise ConfigError("--seeds and --workers are at least 1", "Give a positive number.")
    folder = args.run or Path("runs") / "experiments"
    comparing = args.name in WORLDS
    trials = compare.trials(WORLDS[args.name], args.seeds) if comparing else thresholds.trials(args.name, args.seeds)
    output = take_stdout() if args.json == "-" else None
    outcomes = run_trials(trials, folder, args.workers)
    rows = compare.summary(outcomes) if comparing else thresholds.summary(args.name, outcomes)
    rows += THESIS_TABLE2 if args.name == "table2" else []
    ratios = compare.ratios(outcomes) if comparing else []
    if args.json is not None:
        report: dict[str, object] = {"name": args.name, "results": rows}
        if comparing:
            report["ratios"] = ratios
        text = json.dumps(report, indent=2)
        if output is not None:
            print(text, file=output, flush=True)
            return 0
        write_file(Path(args.json), text)
    print(table(rows))
    if comparing:
        print(f"\nHG-DAgger over LIRA-SPF, by pairs of one seed (thesis, Table II: 2.65 and 2.05)\n{table(ratios)}")
    return 0
