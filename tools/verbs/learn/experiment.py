"""Repeat an experiment of the thesis on the twin, in process, and print its tables beside the thesis's.

Trials of one seed share the layout and the teacher's faults, whatever the method. Each trial that ends is kept in the
folder: run the same command again to go on, or with more seeds to add to it. A trial of other code or other experts
than today's is played again. A run that did not converge within its laps is counted as censored, with the labels it had
used by then. The folder also gets a page (NAME.html) and the drawings.

'all' does every experiment, keeps their summaries and writes RESULTS.md and docs/results; 'results' writes these alone.

examples:
  lira experiment unseen --seeds 10 --workers 2
  lira experiment unseen --seeds 10 --first-seed 362 --pairs line@37,line@38,line@39 --methods kernel
  lira experiment unseen --seeds 10 --methods plus --shift gray
  lira experiment table2 --seeds 10 --workers 2 --methods hold,hg-dagger    # all: every method
  lira experiment race --seeds 10 --scheduler tcp://192.168.1.5:8786 --json race.json
  lira experiment all --seeds 10 --workers 2
  lira experiment results
  lira experiment table2 --seeds 10 --method mylab.methods:Mine     # with a method of your own beside the four
"""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.tools.cli import require
from lira.tools.experiments.registry import REGISTRY, load, words_of
from lira.tools.options import add_json, add_randomise, natural, positive

if TYPE_CHECKING:
    from lira.tools.experiments.output.summary import Summary

FOLDER = Path("runs") / "experiments"
ALL, RESULTS = "all", "results"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    names = "; ".join(f"{name}: {entry.words}" for name, entry in REGISTRY.items()).replace("%", "%%")
    add = parser.add_argument
    add("name", metavar="NAME", help=f"{names}; {ALL}; {RESULTS}; or one of your own: MODULE:OBJECT")
    add("--seeds", type=positive, default=3, help="repetitions, seeds 0, 1, 2, ... (default: %(default)s)")
    add("--first-seed", type=natural, default=0, help="begin with this seed instead of 0")
    add(
        "--methods",
        metavar="NAMES",
        help=f"of unseen, table2 and race, play these, separated by commas; or {ALL}; or kernel, which is plus and all "
        "others with its novice (default: four)",
    )
    add(
        "--method",
        action="append",
        default=[],
        metavar="MODULE:OBJECT",
        help="of unseen, table2 and race, play this method of your own, too; may be given several times",
    )
    add(
        "--experts",
        "--pairs",
        metavar="PAIRS",
        help="other pairs of experts, separated by commas: TASK@SEED, which is trained first if need be, or a folder "
        "with camera.safetensors and lidar.safetensors (default: those of the world)",
    )
    add("--world", help="of unseen: another world, by its name or its TOML file")
    add("--teacher", help="of unseen: scripted (skilled), perfect or unskilled")
    add(
        "--shift",
        help="of unseen: what is other where the novice is tried than where it was taught: gray, boxes, curvature, "
        "noise, camera or slip",
    )
    add_randomise(parser, "of unseen: while it is taught, ")
    add("--ways", help="of unseen: how novices are tried: plain, field, shield, ask (default: plain,shield)")
    add("--laps", type=positive, help="of unseen: who is no better after so many laps is censored (default: 12)")
    add("--more", type=natural, default=0, help="of unseen: teach on for so many laps, to see whether that spoils it")
    add("--workers", type=positive, default=1, help="processes side by side (default: %(default)s)")
    add("--scheduler", metavar="ADDRESS", help="run on this Dask cluster instead, like tcp://192.168.1.5:8786")
    add("--run", type=Path, default=FOLDER, metavar="DIR", help="keeps the trials and pages (default: %(default)s)")
    add_json(parser)
    add("--summaries", type=Path, metavar="DIR", help="summaries of all experiments (default: those of the project)")
    add(
        "--out",
        type=Path,
        metavar="FILE",
        help="where all and results write, with docs/results beside it (default: the project's RESULTS.md)",
    )


def run(args: argparse.Namespace) -> int:
    """Run the trials that are missing and print the tables."""
    from lira.tools.experiments.output.summary import to_json
    from lira.tools.output.machine import output_for, tell

    if args.name in (ALL, RESULTS):
        return write_results(args)
    output = output_for(args.json)
    summary, page = play(args, args.name)
    tell(args.json, output, to_json(summary))
    if args.json != "-":
        show(summary, page)
    return 0


def play(args: argparse.Namespace, name: str) -> "tuple[Summary, Path]":
    """Run one experiment; return its summary and its page."""
    require("joblib", "matplotlib", "tqdm", *(["distributed"] if args.scheduler else []))
    from lira.fusion.methods.presets import file_name
    from lira.tools.experiments.output.page import write_page
    from lira.tools.experiments.output.summary import summarise
    from lira.tools.experiments.playing.pools import Cluster, Here
    from lira.tools.experiments.playing.runner import run_trials
    from lira.tools.experiments.selection import Selection
    from lira.tools.runs.expert_training import provide

    experiment = load(name)
    pool = Here(args.workers) if args.scheduler is None else Cluster(args.scheduler)
    selection = Selection(
        seeds=args.seeds,
        first_seed=args.first_seed,
        methods=ALL if args.name == ALL and experiment.methods else args.methods,
        own=args.method,
        pairs=args.experts.split(",") if args.experts else (),
        world=args.world,
        teacher=args.teacher,
        shift=args.shift,
        randomised=args.randomise,
        laps=args.laps,
        more=args.more,
        ways=tuple(args.ways.split(",")) if args.ways else (),
        all_experiments=args.name == ALL,
    )
    trials = selection.trials(experiment, name)
    for pair in dict.fromkeys(trial.pair for trial in trials):
        provide(pair)
    outcomes = run_trials(trials, args.run, pool)
    command = f"lira experiment {name} {selection.command}"
    summary = summarise(
        file_name(name) + selection.elsewhere, words_of(name, experiment), command, args.seeds, experiment, outcomes
    )
    return summary, write_page(args.run, summary, experiment.figures(outcomes))


def show(summary: "Summary", page: Path) -> None:
    """Print tables, verdicts and where the page is."""
    from lira.tools.output.machine import table

    for each in summary.tables:
        print(f"\n{each.title}\n{table(each.rows)}")
        if each.note:
            print(each.note)
    if summary.findings:
        print("\nAgainst the thesis")
    for finding in summary.findings:
        verdict = "agrees" if finding.agrees else "differs"
        print(f"  {verdict:<8} {finding.claim}; thesis {finding.thesis}; ours {finding.ours}")
    print(f"\npage: {page}")


def write_results(args: argparse.Namespace) -> int:
    """Play everything first if asked to; then write the documents from the summaries that are there."""
    from lira.tools.experiments.output import document, lead
    from lira.tools.experiments.output.fields import lacking
    from lira.tools.experiments.output.summary import read_summaries, write_summary

    if args.methods is not None or args.method:
        raise ConfigError(f"{args.name} takes no --methods", "It is about all of them.")
    folder = args.summaries or document.SUMMARIES
    for name in REGISTRY if args.name == ALL else ():
        print(f"\n{name}: {REGISTRY[name].words}")
        summary, page = play(args, name)
        write_summary(folder / f"{name}.json", summary)
        show(summary, page)
    summaries = read_summaries(folder, list(REGISTRY))
    if not summaries:
        raise ConfigError(f"{folder} holds no summary", "Make them with: lira experiment all")
    out = args.out or document.DOCUMENT
    document.write_documents(out, document.documents(summaries, document.read_causes(), out.name))
    lead.draw(summaries, out.parent)
    for each in filter(lead.leads, summaries):
        if lacks := lacking(each):
            path = folder / f"{each.name}.json"
            print(f"{path} is of another version: no {', no '.join(lacks)}, and so empty cells", file=sys.stderr)
            print(f"  Play it again: {each.command} --json {path}", file=sys.stderr)
    print(f"results: {out}, and {document.PAGES} beside it")
    return 0
