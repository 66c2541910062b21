"""Say why a robot did what it did: who drove, what everybody proposed, what decided, what the wheels got and why.

Of a recording, or of a robot on the bus as it is now. It names the line of Algorithm 1 (thesis, section III) that
decided, the activations and the consensus behind it, what was learned, the command that was applied with its age and
its clamps, and why the robot stood or moved.

examples:
  lira explain runs/demo-20261127-101500 --last-call
  lira explain runs/mine --last-stop --out why        with the picture and the scan of that moment, into why/
  lira explain runs/mine --at 52.4 --json -           52.4 s after the recording began
  lira explain runs/mine --at 52.4 --labels           and which labels made the novice's action
  lira explain --connect 192.168.1.20:7447            the robot as it is now
"""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.tools.options import add_client, add_json

if TYPE_CHECKING:
    from lira.tools.inquiry.moment import Moment

HEARD_S = 1.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("file", type=Path, nargs="?", metavar="FILE", help="an .mcap file, or the folder of a recording or a run")
    when = parser.add_mutually_exclusive_group()
    when.add_argument("--at", type=float, metavar="S", help="at this time, in seconds since the recording began")
    when.add_argument("--last-call", action="store_true", help="when the person was called last")
    when.add_argument("--last-stop", action="store_true", help="when the robot stopped last (default)")
    add(
        "--labels",
        action="store_true",
        help="and which labels made the novice's action (the run is gone through again)",
    )
    add("--out", type=Path, metavar="DIR", help="write the picture and the scan of that moment there")
    add_client(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Find the moment and explain it."""
    from lira.tools.inquiry.pictures import write_pictures
    from lira.tools.inquiry.why import plain, words
    from lira.tools.output.machine import output_for, tell

    if args.file is None and (args.at is not None or args.last_call or args.last_stop or args.labels):
        raise ConfigError("times and labels are those of a recording", "Name its file, or ask for now with neither.")
    output = output_for(args.json)
    moment = now(args) if args.file is None else then(args)
    files = [] if args.out is None else write_pictures(moment, args.out)
    found = {**plain(moment), "files": [str(path) for path in files]}
    lines = [*words(moment), *(behind(args, moment) if args.labels else [])]
    lines = [*lines, *([f"written: {', '.join(map(str, files))}"] if files else [])]
    tell(args.json, output, found, "\n".join(lines))
    return 0


def then(args: argparse.Namespace) -> "Moment":
    """The moment of a recording."""
    from lira.tools.inquiry.moment import last_call, last_stop, moment_at
    from lira.tools.recording.reader import Recording

    recording = Recording(args.file)
    if args.at is not None:
        return moment_at(recording, recording.head.began_s + args.at)
    return moment_at(recording, last_call(recording) if args.last_call else last_stop(recording))


def behind(args: argparse.Namespace, moment: "Moment") -> list[str]:
    """Which labels made what the novice did."""
    from lira.tools.inquiry.behind import labels_behind
    from lira.tools.inquiry.behind import words as behind_words
    from lira.tools.inquiry.trace import read_traces
    from lira.tools.recording.reader import Recording

    if moment.step is None:
        return ["nobody learned then"]
    head = moment.head
    trace = read_traces(Recording(args.file))[moment.methods - 1]
    found = labels_behind(trace, head.info.profile, moment.step.number)
    return ["the labels behind the novice's action, the largest part first:", *behind_words(found, head.began_s)]


def now(args: argparse.Namespace) -> "Moment":
    """The moment at hand."""
    from lira.hal.bus.services import ask_info
    from lira.hal.client.connect import on_bus
    from lira.tools.cli import version
    from lira.tools.inquiry.moment import moment_now
    from lira.tools.launch.lifetime import CLOSE_S
    from lira.tools.recording.layout import Head

    with on_bus(args.connect, args.name, watch=True, close_s=CLOSE_S) as bus:
        info = ask_info(bus)
        began_ns = time.time_ns()
        return moment_now(bus, Head(bus.robot, version(), 0, began_ns, info), HEARD_S)
