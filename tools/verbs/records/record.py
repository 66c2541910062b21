"""Record everything on a robot's bus: sensors, who drives, decisions, what a person asks, as an MCAP recording.

`lira fusion`, `lira teach` and `lira demo` start one for each run. It hears what anybody may hear on the bus; commands
go to the robot alone, so what reached the wheels is in `cmd_vel/applied`. ROS 2, Foxglove and Rerun open it as it is;
for a robot far away it is best run on the robot itself, for the radio's sake.

examples:
  lira record                                       until Ctrl-C, into recordings/<date-time>
  lira record --connect 192.168.1.20:7447 --out runs/mine/recording
  lira record --recover recordings/20261127-120000  mend what was cut off

exit status: 0 if all was recorded, 2 if the disk took no more or something else went wrong
"""

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.words import plural
from lira.tools.options import DEFAULT, add_client, natural

if TYPE_CHECKING:
    from threading import Event

NICENESS = 5
RECORDINGS = Path("recordings")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_client(parser)
    add = parser.add_argument
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--out", type=Path, metavar="DIR", help="its folder (default: recordings/<date-time>)")
    where.add_argument("--run", type=Path, metavar="DIR", help="a run's folder: one more recording in it")
    add("--split", type=natural, default=2000, metavar="MB", help=f"begin another file after so much {DEFAULT}")
    add("--memory", type=natural, default=64, metavar="MB", help=f"what may wait for a slow disk {DEFAULT}")
    add("--recover", type=Path, metavar="FILE", help="instead: give what was cut off an index again")


def run(args: argparse.Namespace) -> int:
    """Record until told to stop."""
    from lira.hal.signals import stop_on_signal
    from lira.tools.output.say import say

    if args.recover is not None:
        from lira.tools.recording.recover import recover

        for line in recover(args.recover):
            say(line)
        return 0
    with stop_on_signal() as stop:
        return record(args, stop)


def record(args: argparse.Namespace, stop: "Event") -> int:
    """Record until `stop` is set, or the disk takes no more."""
    from lira.hal.client.connect import on_bus
    from lira.tools.cli import version
    from lira.tools.launch.lifetime import CLOSE_S
    from lira.tools.launch.notify import Notifier
    from lira.tools.output.places import check_folder, own_folder
    from lira.tools.output.say import say
    from lira.tools.recording.beside import READY, new_folder
    from lira.tools.recording.recorder import Recorder, listen
    from lira.tools.recording.writer import RecordingWriter

    given: Path | None = new_folder(args.run) if args.run else args.out
    check_folder(given or RECORDINGS)
    notifier = Notifier.from_environment()
    with on_bus(args.connect, args.name, watch=True, close_s=CLOSE_S) as bus:
        head, tap, heard = listen(bus, version(), shlex.join(["lira", *sys.argv[1:]]), stop)
        folder = given or own_folder(RECORDINGS)
        writer = RecordingWriter(folder, head, split_bytes=args.split * 2**20)
        os.nice(NICENESS)
        recorder = Recorder(tap, writer, head, say, most_bytes=args.memory * 2**20)
        words = f"{READY}{args.name}' at {args.connect} into {folder}"
        say(words)
        notifier.ready(words)
        recorder.run(stop, heard, notifier.alive)
    lost = recorder.lost.total()
    say(f"recorded {plural(recorder.count, 'message')}, {writer.size_bytes / 1e6:.1f} MB, lost {lost}: {folder}")
    return 0
