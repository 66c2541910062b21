"""Put a recorded run through its method again, offline: what it saw, and what the human did.

By the same method the same decisions, labels and weights come out, to the bit: it prints `identical`, or where they
part, which a change to the code does, or another machine. With other settings, or another method, it says what would
have been called, driven and learned otherwise, with the robot where it was and the human doing what they did.

examples:
  lira rerun runs/demo-20261127-101500
  lira rerun runs/mine --set theta=0.06 --set consensus=0.2
  lira rerun runs/mine --method hold --page otherwise.html
  lira rerun runs/mine --method plus --json -

exit status: 0, 1 if the same method did not do the same, 2 if it cannot be gone through
"""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lira.hal.words import plural
from lira.tools.options import add_json

SHOWN = 3  # differences: what comes after the first follows from it

if TYPE_CHECKING:
    from lira.tools.inquiry.otherwise import Otherwise
    from lira.tools.inquiry.rerun import Again


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="an .mcap file, the folder of a recording, or of a run")
    add("--method", help="by this method instead, as in `lira fusion`")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="with this setting of the method; repeatable")
    add("--page", type=Path, metavar="FILE", help="write what would have been otherwise as a page (.html)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Go through every method of the recording and say what came of it."""
    from msgspec import to_builtins

    from lira.tools.inquiry.otherwise import compare
    from lira.tools.inquiry.page import write_page
    from lira.tools.inquiry.rerun import go_again
    from lira.tools.inquiry.settings import changed
    from lira.tools.inquiry.trace import read_traces
    from lira.tools.output.machine import output_for, tell
    from lira.tools.recording.reader import Recording

    output = output_for(args.json)
    recording = Recording(args.file)
    found: list[dict[str, Any]] = []
    lines: list[str] = []
    identical = True
    for trace in read_traces(recording):
        recipe = changed(trace.recipe, args.method, args.set)
        began_s = time.monotonic()
        again = go_again(trace, recording.head.info.profile, recipe)
        took_s = time.monotonic() - began_s
        if recipe is None:
            identical &= again.identical
            found.append(plain(again))
            lines += words(again, took_s)
        else:
            otherwise = compare(again)
            found.append(to_builtins(otherwise))
            lines += table(otherwise, trace.recipe.preset.name, name_of(args))
            if args.page is not None:
                lines.append(f"page: {write_page(args.page, otherwise, trace, name_of(args))}")
    tell(args.json, output, found, "\n".join(lines))
    return 0 if identical else 1


def words(again: "Again", took_s: float) -> list[str]:
    """Whether it was the same, or where it parts."""
    trace = again.trace
    name = trace.recipe.preset.name
    if again.identical:
        assert again.final is not None
        final = again.final
        what = f"{plural(len(again.proposed), 'decision')}, {plural(final.labels, 'label')} learned"
        what += f", {plural(final.steps, 'training step')}"
        what += f", novice {final.weights[:12]}" if final.weights else ""
        return [f"identical: {what} by '{name}'; {trace.seconds:.0f} s in {took_s:.1f} s"]
    lines = [f"'{name}' does not do the same:"]
    if trace.missing:
        lines.append(f"  not recorded: {plural(trace.missing, 'message')} of its calls")
    for each in again.differences[:SHOWN]:
        lines.append(f"  at {each.time_s:.2f} s, call {each.number} ({each.name})")
        lines += [f"    was {each.was}", f"    now {each.now}"]
    return lines


def plain(again: "Again") -> dict[str, Any]:
    """The same as JSON has it."""
    from msgspec import to_builtins

    return {
        "identical": again.identical,
        "method": again.trace.recipe.preset.name,
        "decisions": len(again.proposed),
        "missing": again.trace.missing,
        "seconds": again.trace.seconds,
        "final": to_builtins(again.final),
        "differences": [
            {"time_s": each.time_s, "call": each.number, "name": each.name, "was": str(each.was), "now": str(each.now)}
            for each in again.differences
        ],
    }


def table(otherwise: "Otherwise", was: str, now: str) -> list[str]:
    """What would have been otherwise, to read."""
    from lira.tools.output.table import format_table

    rows = [(row.name, str(row.was), str(row.now), f"{row.now - row.was:+d}") for row in otherwise.rows]
    lines = [f"'{was}' as recorded, and with {now}", "", format_table(("", "recorded", "then", "difference"), rows), ""]
    if otherwise.moments:
        first = otherwise.moments[0]
        lines.append(
            f"parts at {first.time_s:.1f} s: {first.was_driver} drove (call: {first.was_call}), "
            f"{first.now_driver} would have (call: {first.now_call})"
        )
    if otherwise.alone:
        lines.append(f"alone, it would have turned otherwise in {otherwise.aside} of {plural(otherwise.alone, 'step')}")
    return lines


def name_of(args: argparse.Namespace) -> str:
    """What is changed, in a word or two."""
    return ", ".join(filter(None, [args.method, *args.set]))
