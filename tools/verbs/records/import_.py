"""Take a LeRobot data set or a bag as labels of a run, given by whoever drove there, from which a learner starts.

A data set (v3) needs a picture, an action of two numbers in [-1, 1] (linear, angular), and for a robot with a lidar its
scan as the networks see it; what `lira export lerobot` wrote has all that. A bag (ROS 1 or 2, MCAP or SQLite) needs a
scan, a picture and a command in m/s and rad/s; where nobody drives nothing is taken.

examples:
  lira import datasets/mine --run runs/warm                        frames in which a person drove
  lira import datasets/theirs --run runs/warm --map image=observation.images.front --frames all
  lira import bags/monday --run runs/warm --profile rosbot2 --command /cmd_vel
  lira fusion --method plus --run runs/warm                        goes on from there
"""

import argparse
from pathlib import Path

from lira.hal.words import plural
from lira.tools.options import add_profile

ROLES = ("scan", "camera", "command")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="folder of a LeRobot data set, or of a bag")
    add("--run", type=Path, required=True, metavar="DIR", help="folder of the run whose labels these become")
    add_profile(parser, "thesis-sim", "robot that is to learn from it,")
    add(
        "--frames",
        choices=("all", "interventions", "buffer"),
        help="frames of a data set: all, those in which a person drove "
        "(default), or those that the learner of a run of ours learned",
    )
    add("--map", action="append", default=[], type=_pair, metavar="NAME=FEATURE", help="which feature is image or scan")
    for role in ROLES:
        add(f"--{role}", metavar="TOPIC", help=f"which topic of a bag is the {role}")


def _pair(text: str) -> tuple[str, str]:
    name, _, feature = text.partition("=")
    if not (name and feature):
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=FEATURE")
    return name, feature


def run(args: argparse.Namespace) -> int:
    """Read it, and append what was shown to the run's labels."""
    from lira.hal.profile import load_profile
    from lira.tools.export.demonstrations import keep
    from lira.tools.output.label_words import by_source
    from lira.tools.runs.names import LABELS

    profile, path = load_profile(args.profile), args.run / LABELS
    if (args.file / "meta").is_dir():
        from lira.tools.export.lerobot_reader import read_lerobot

        shown = read_lerobot(args.file, profile, args.frames, dict(args.map))
    else:
        from lira.tools.export.bag_reader import read_bag

        shown = read_bag(args.file, profile, {role: topic for role in ROLES if (topic := getattr(args, role))})
    tally = keep(shown, path, profile)
    cut = f"; {tally.clipped} of them were more than the robot can do, and are cut" if tally.clipped else ""
    without = f"; {tally.without} without an action are left out" if tally.without else ""
    print(f"in {path}, to be learned: {plural(tally.taken.total(), 'label')} ({by_source(tally.taken)}){cut}{without}")
    return 0
