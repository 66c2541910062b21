"""Look at the labels of a log (labels.lira), take some back, and say which of them make an action.

Nothing that was stored is ever deleted. What is taken back stays in the log, marked, and can be learned again; the
novice of plus beside the log is learned anew at once. Bytes that were lost, added or overwritten cost the labels they
hit; all others are found. A learner that opens a damaged log does the same as --repair: it goes on with a clean file,
and the damaged one stays beside it.

examples:
  lira labels list runs/mine/labels.lira               all labels, with the numbers by which the others know them
  lira labels list runs/mine --source human            ... those of the human alone
  lira labels undo runs/mine                           take back the last intervention; the folder will do
  lira labels undo FILE --number 12 40-43              ... these labels
  lira labels undo FILE --source camera --from 30 --to 35   ... what the camera expert showed in these seconds
  lira labels redo FILE --number 12                    learn it again
  lira labels explain FILE --number 12                 which labels make what the novice does where that one was given
  lira labels explain FILE --time 41.2 --run 0         ... at the label that is nearest to this time
  lira labels merge A B -o C                           the labels of two runs of one robot in one log
  lira labels check FILE --repair                      write a clean file; the old one becomes labels.lira.damaged

exit status: 0 if it was done; check: 1 if something cannot be read (and was not repaired); 2 if it is no log
"""

import argparse
import sys
from collections.abc import Callable
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lira.hal.errors import ConfigError
from lira.hal.words import plural
from lira.tools.options import add_json
from lira.tools.runs.names import LABELS, in_run

if TYPE_CHECKING:
    from lira.fusion.log.label_salvage import Survey
    from lira.tools.labels.choose import Wanted


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lira.tools.labels.numbers import numbers
    from lira.tools.output.when import stamp

    add = parser.add_argument
    add("what", choices=tuple(DOES), help="what to do")
    log = partial(in_run, name=LABELS)
    add("file", type=log, nargs="+", metavar="FILE", help="the log, or its run's folder; for merge two of them")
    add("--number", type=numbers, nargs="+", default=(), metavar="N", help="labels by number, like 12 or 40-43")
    add("--source", help="list, undo, redo: labels of the human, or of an expert by name")
    add(
        "--from",
        type=stamp,
        dest="from_s",
        metavar="TIME",
        help="list, undo, redo: from this time of the robot's clock on, in seconds or as list prints it",
    )
    add("--to", type=stamp, dest="to_s", metavar="TIME", help="list, undo, redo: up to this time")
    add("--time", type=stamp, metavar="TIME", help="explain: the label that is nearest to this time")
    add("--run", type=int, metavar="R", help="of this run in the log (default: the last that fits; list: all)")
    add("-o", "--output", type=Path, metavar="FILE", help="merge: the new log")
    add(
        "--repair", action="store_true", help="check: put a clean file in its place, and keep the damaged one beside it"
    )
    add("--profile", help="check: whose labels they are, if the file does not say (default: the known robots)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Do it, and say what came of it."""
    needed = 2 if args.what == "merge" else 1
    if len(args.file) != needed:
        raise ConfigError(f"{args.what} takes {plural(needed, 'log')}", "See: lira labels --help")
    given = [option for name, option in OPTIONS.items() if getattr(args, name) not in (None, (), False)]
    useless = [option for option in given if option not in TAKES[args.what]]
    if useless:
        can = f"It takes {', '.join(TAKES[args.what])}" if TAKES[args.what] else "Leave it out"
        raise ConfigError(f"{args.what} does nothing with {', '.join(useless)}", f"{can}; see: lira labels --help")
    return DOES[args.what](args)


def list_labels(args: argparse.Namespace) -> int:
    """Show all labels, or those that are meant."""
    from lira.fusion.log.label_edit import read_heads
    from lira.hal.errors import LiraError
    from lira.tools.labels.choose import fitting
    from lira.tools.labels.relearn import contradictions, relearn
    from lira.tools.labels.words import list_rows, list_table

    path = args.file[0]
    labels = read_heads(path)
    wanted = wanted_of(args)
    shown = range(len(labels)) if wanted.nothing else set(fitting(labels, wanted))
    try:
        aside = contradictions(*relearn(path))
    except LiraError:
        aside = {}  # no novice is there that could tell
    rows = [row for number, row in enumerate(list_rows(labels, aside)) if number in shown]
    head = f"{plural(len(labels), 'label')} given, {sum(label.stored for label in labels)} of them learned"
    head += "" if wanted.nothing else f"; here {len(rows)} of them"
    return tell(args, {"file": str(path), "labels": rows}, f"{head}\n\n{list_table(rows)}")


def undo(args: argparse.Namespace) -> int:
    """Take labels back, or learn them again."""
    from lira.fusion.log.label_edit import correct, read_heads
    from lira.tools.labels.choose import choose
    from lira.tools.labels.numbers import ranges
    from lira.tools.labels.relearn import note, rewrite
    from lira.tools.labels.words import unchanged

    path, again = args.file[0], args.what == "redo"
    labels = read_heads(path)
    wanted = wanted_of(args)
    undone = [number for number, label in enumerate(labels) if label.undone]
    found = undone if again and wanted.nothing else choose(labels, wanted)
    changed = correct(path, found, stored=again)
    numbers = [number for number in found if (labels[number].undone if again else labels[number].stored)]
    what = "learned again" if again else "taken back"
    lines = [f"{what}: {plural(len(changed), 'label')} {ranges(numbers)}".rstrip()]
    if not found:
        lines.append("no label of this log is taken back")
    lines += unchanged(labels, [number for number in found if number not in set(numbers)])
    if changed:
        lines += filter(None, [rewrite(path), note(path, len(changed), stored=again)])
    if changed and not again:
        lines.append(f"they stay in the log; to learn them again: lira labels redo {path} --number {ranges(numbers)}")
    return tell(args, {"file": str(path), "numbers": numbers, "stored": again}, "\n".join(lines))


def explain(args: argparse.Namespace) -> int:
    """Say which labels make an action."""
    from lira.fusion.log.label_edit import read_heads
    from lira.fusion.log.label_log import read_demonstrations
    from lira.tools.labels.choose import nearest, one_of
    from lira.tools.labels.relearn import contradictions, relearn
    from lira.tools.labels.words import pair, part_rows, part_table, state
    from lira.tools.output.when import when

    path = args.file[0]
    labels = read_heads(path)
    if (args.time is None) is (not args.number):
        raise ConfigError("explain needs one label", "Give its --number, or a --time near it.")
    if args.number and args.run is not None:
        raise ConfigError("a number says by itself of which run a label is", "Give --run with --time only.")
    at = one_of(labels, wanted_of(args).numbers) if args.number else nearest(labels, args.time, args.run)
    novice, learned = relearn(path)
    label = labels[at]
    seen = next(islice(read_demonstrations(path), at, None)).features
    rows = part_rows(novice.explain(seen), learned, labels)
    action, alone, deviation = novice.act(seen), novice.alone(seen), novice.deviation(seen)
    became = state(label, contradictions(novice, learned).get(at))
    where = f"label {at} (run {label.run}, lap {label.lap}, {when(label.stamp_s)}) says {pair(label.action)}"
    head = (
        f"{where} by {label.source} ({became}); the novice does {pair(action)}, alone {pair(alone)}, give or take "
        f"{deviation[0]:.2f}, {deviation[1]:.2f}"
    )
    found = {"number": at, "state": became, "action": action, "alone": alone, "deviation": deviation, "parts": rows}
    return tell(args, {"file": str(path), **found}, f"{head}\n\n{part_table(rows)}")


def merge(args: argparse.Namespace) -> int:
    """Make one log of two."""
    from lira.fusion.log import label_edit

    if args.output is None:
        raise ConfigError("merge needs a file to write to", "Give it with -o FILE.")
    one, other = args.file
    count, both = label_edit.merge(one, other, args.output)
    twice = f"; {both} of them are in both, and kept once" if both else ""
    words = f"{args.output}: {plural(count, 'label')} given{twice}\nto go on with them: put it into a folder as "
    words += "labels.lira, then lira fusion --method NAME --run DIR"
    return tell(args, {"file": str(args.output), "labels": count, "in_both": both}, words)


def check(args: argparse.Namespace) -> int:
    """Check, repair if asked to, and say what was found."""
    from lira.fusion.log.label_log import check_log, repair_log
    from lira.hal.profile import known_profiles, load_profile

    path = args.file[0]
    robots = [load_profile(name) for name in ([args.profile] if args.profile else known_profiles())]
    kept: Path | None = None
    if args.repair:
        found, kept = repair_log(path, robots)
    else:
        found = check_log(path, robots)
    tell(args, row(path, found, kept), words(path, found, kept))
    return 1 if found.words() and kept is None else 0


DOES: dict[str, Callable[[argparse.Namespace], int]] = {
    "list": list_labels,
    "undo": undo,
    "redo": undo,
    "explain": explain,
    "merge": merge,
    "check": check,
}

# What an argument is called, and who does something with it; --json is for all.
OPTIONS = {
    "number": "--number",
    "source": "--source",
    "from_s": "--from",
    "to_s": "--to",
    "time": "--time",
    "run": "--run",
    "output": "-o",
    "repair": "--repair",
    "profile": "--profile",
}
WHICH = ("--number", "--source", "--from", "--to", "--run")
TAKES: dict[str, tuple[str, ...]] = {
    "list": WHICH,
    "undo": WHICH,
    "redo": WHICH,
    "explain": ("--number", "--time", "--run"),
    "merge": ("-o",),
    "check": ("--repair", "--profile"),
}


def wanted_of(args: argparse.Namespace) -> "Wanted":
    """Which labels the arguments mean."""
    from lira.tools.labels.choose import Wanted

    numbers = tuple(number for each in args.number for number in each)
    return Wanted(numbers, args.source, args.from_s, args.to_s, args.run)


def tell(args: argparse.Namespace, found: dict[str, Any], said: str) -> int:
    """Write JSON where it is wanted, and say the same in words unless JSON goes where they would."""
    from lira.tools.output import machine

    machine.tell(args.json, sys.stdout, found, said)
    return 0


def row(path: Path, found: "Survey", kept: Path | None) -> dict[str, Any]:
    """What was found, as JSON has it."""
    return {
        "file": str(path),
        "profile": found.form.profile,
        "labels": found.count,
        "runs": found.newest_run + 1,
        "damages": [{"at_byte": damage.at, "bytes": damage.length} for damage in found.damages],
        "torn_bytes": found.torn_bytes,
        "kept": None if kept is None else str(kept),
    }


def words(path: Path, found: "Survey", kept: Path | None) -> str:
    """What was found, for a person."""
    given, runs = plural(found.count, "label"), plural(found.newest_run + 1, "run")
    lines = [f"{path}: {given} given, of '{found.form.profile}' in {runs}"]
    if not found.words():
        lines.append("  nothing is damaged")
    else:
        lines.append(f"  {found.words()}")
        lines.append(f"  clean now; the old file is kept as {kept}" if kept else "  to mend it, say --repair")
    return "\n".join(lines)
