"""Repeat an experiment of the thesis on the twin, in process, and print its tables beside the thesis's.

Trials of one seed share the layout and the teacher's faults, whatever the method. Each trial that ends is kept in the
folder: run the same command again to go on, or with more seeds to add to it. A trial of other code or other experts
than today's is played again. A run that did not converge within its laps is counted as censored, with the labels it had
used by then. The folder also gets a page (NAME.html) and the drawings.

'all' does every experiment, keeps their summaries and writes RESULTS.md; 'results' writes RESULTS.md alone.

examples:
  lira experiment table2 --seeds 10 --workers 2
  lira experiment table2 --seeds 10 --workers 2 --methods hold,hg-dagger    # all: every method
  lira experiment race --seeds 10 --scheduler tcp://192.168.1.5:8786 --json race.json
  lira experiment all --seeds 10 --workers 2
  lira experiment results
  lira experiment table2 --seeds 10 --method mylab.methods:Mine     # with a method of your own beside the four
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.tools.experiments.registry import REGISTRY, load, words_of
from lira.tools.options import add_json, natural

if TYPE_CHECKING:
    from lira.tools.experiments.experiment import Experiment
    from lira.tools.experiments.summary import Summary
    from lira.tools.experiments.trial import Trial

FOLDER = Path("runs") / "experiments"
ALL, RESULTS = "all", "results"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    names = "; ".join(f"{name}: {entry.words}" for name, entry in REGISTRY.items())
    add = parser.add_argument
    add("name", metavar="NAME", help=f"{names}; {ALL}; {RESULTS}; or one of your own: MODULE:OBJECT")
    add("--seeds", type=int, default=3, help="repetitions, seeds 0, 1, 2, ... (default: %(default)s)")
    add("--first-seed", type=natural, default=0, help="begin with this seed instead of 0")
    add(
        "--methods",
        metavar="NAMES",
        help=f"of unseen, table2 and race, play these, separated by commas, or {ALL} (default: four)",
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
        metavar="PAIR",
        help="another pair of experts: TASK@SEED, which is trained first if need be, or a folder with "
        "camera.safetensors and lidar.safetensors (default: those of the world)",
    )
    add("--workers", type=int, default=1, help="processes side by side (default: %(default)s)")
    add("--scheduler", metavar="ADDRESS", help="run on this Dask cluster instead, like tcp://192.168.1.5:8786")
    add("--run", type=Path, default=FOLDER, metavar="DIR", help="keeps the trials and pages (default: %(default)s)")
    add_json(parser)
    add("--summaries", type=Path, metavar="DIR", help="summaries of all experiments (default: those of the project)")
    add("--out", type=Path, metavar="FILE", help="where all and results write (default: the project's RESULTS.md)")


def run(args: argparse.Namespace) -> int:
    """Run the trials that are missing and print the tables."""
    from lira.tools.experiments.summary import to_json
    from lira.tools.output.machine import take_stdout, write_file

    if args.seeds < 1 or args.workers < 1:
        raise ConfigError("--seeds and --workers are at least 1", "Give a positive number.")
    if args.name in (ALL, RESULTS):
        return write_results(args)
    output = take_stdout() if args.json == "-" else None
    summary, page = play(args, args.name)
    if output is not None:
        print(to_json(summary), file=output, flush=True)
        return 0
    if args.json is not None:
        write_file(Path(args.json), to_json(summary))
    show(summary, page)
    return 0


def play(args: argparse.Namespace, name: str) -> "tuple[Summary, Path]":
    """Run one experiment; return its summary and its page."""
    import msgspec

    from lira.fusion.methods.presets import file_name
    from lira.tools.experiments.page import write_page
    from lira.tools.experiments.pools import Cluster, Here
    from lira.tools.experiments.runner import run_trials
    from lira.tools.experiments.summary import summarise
    from lira.tools.runs.expert_training import provide

    experiment = load(name)
    pool = Here(args.workers) if args.scheduler is None else Cluster(args.scheduler)
    methods = ALL if args.name == ALL and experiment.methods else args.methods
    chosen = chosen_methods(methods, experiment, name)
    listed = experiment.trials(args.seeds)
    trials = [trial for trial in listed if not chosen or trial.method.name in chosen]
    if args.method:
        trials += own_trials(args.method, listed, experiment, name)
    trials = [msgspec.structs.replace(each, seed=args.first_seed + each.seed) for each in trials]
    if args.experts is not None:
        if args.name != ALL and all(trial.experts for trial in trials):
            raise ConfigError(f"{name} takes no --experts", "It is played with experts of its own choice.")
        trials = [msgspec.structs.replace(each, experts=each.experts or args.experts) for each in trials]
    for pair in dict.fromkeys(trial.pair for trial in trials):
        provide(pair)
    outcomes = run_trials(trials, args.run, pool)
    command = f"lira experiment {name} --seeds {args.seeds}" + ("" if methods is None else f" --methods {methods}")
    command += f" --first-seed {args.first_seed}" if args.first_seed else ""
    command += "" if args.experts is None else f" --experts {args.experts}"
    command += "".join(f" --method {each}" for each in args.method)
    summary = summarise(file_name(name), words_of(name, experiment), command, args.seeds, experiment, outcomes)
    return summary, write_page(args.run, summary, experiment.figures(outcomes))


def own_trials(names: list[str], listed: "list[Trial]", experiment: "Experiment", name: str) -> "list[Trial]":
    """Return the trials of methods of one's own: those of one that is known, on its layouts and with its proof."""
    import msgspec

    from lira.fusion.methods.presets import method_named

    if not experiment.methods:
        raise ConfigError(f"{name} takes no --method", "It needs all of its methods together.")
    like = [trial for trial in listed if trial.method.name == experiment.methods[0]]
    return [
        msgspec.structs.replace(
            trial, method=msgspec.structs.replace(method_named(own), syllabus=trial.method.syllabus)
        )
        for own in names
        for trial in like
    ]


def chosen_methods(words: str | None, experiment: "Experiment", name: str) -> set[str]:
    """Return the methods that were asked for, or the usual ones; nothing where there is no choice.

    Raises `ConfigError`.
    """
    known = experiment.methods
    if words is None:
        return set(experiment.usual)
    if not known:
        raise ConfigError(f"{name} takes no --methods", "It needs all of its methods together.")
    if words == ALL:
        return set(known)
    chosen = set(words.split(","))
    if not chosen <= set(known):
        raise ConfigError(f"{name} has no method '{min(chosen - set(known))}'", f"Known: {', '.join(known)}; or {ALL}.")
    return chosen


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
    """Play everything first if asked to; then write RESULTS.md from the summaries that are there."""
    from lira.tools.experiments import document
    from lira.tools.experiments.summary import read_summaries, write_summary

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
    document.write_document(out, document.document(summaries, document.read_causes()))
    print(f"results: {out}")
    return 0
