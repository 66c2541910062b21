"""Look through a log of labels (labels.lira) for damage. Nothing that was stored is ever deleted.

Bytes that were lost, added or overwritten cost the labels they hit; all others are found. A learner that opens a
damaged log does the same as --repair: it goes on with a clean file, and the damaged one stays beside it.

examples:
  lira labels check runs/mine/labels.lira              what is in it, and what cannot be read
  lira labels check runs/mine/labels.lira --repair     write a clean file; the old one becomes labels.lira.damaged
  lira labels check runs/mine/labels.lira --json -     the same as JSON

exit status: 0 if all of it can be read (or now can), 1 if not, 2 if it is no log
"""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lira.tools.options import add_json

if TYPE_CHECKING:
    from lira.fusion.log.label_salvage import Survey


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("what", choices=("check",), help="what to do")
    add("file", type=Path, metavar="FILE", help="the log")
    add("--repair", action="store_true", help="put a clean file in its place, and keep the damaged one beside it")
    add("--profile", help="whose labels they are, if the file does not say (default: the known robots)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Check, repair if asked to, and say what was found."""
    from lira.fusion.log.label_log import check_log, repair_log
    from lira.hal.profile import known_profiles, load_profile
    from lira.tools.output.machine import write_file

    robots = [load_profile(name) for name in ([args.profile] if args.profile else known_profiles())]
    kept: Path | None = None
    if args.repair:
        found, kept = repair_log(args.file, robots)
    else:
        found = check_log(args.file, robots)
    text = json.dumps(row(args.file, found, kept), indent=2)
    if args.json not in (None, "-"):
        write_file(Path(args.json), text)
    print(text if args.json == "-" else words(args.file, found, kept), flush=True)
    return 1 if found.words() and kept is None else 0


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
    lines = [f"{path}: {found.count} labels of '{found.form.profile}' in {found.newest_run + 1} runs"]
    if not found.words():
        lines.append("  nothing is damaged")
    else:
        lines.append(f"  {found.words()}")
        lines.append(f"  clean now; the old file is kept as {kept}" if kept else "  to mend it, say --repair")
    return "\n".join(lines)
