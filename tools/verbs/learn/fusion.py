"""The learner: reads the robot's sensors, decides five times a second, drives, and learns from whoever helps.

It drives whatever robot has that name on the bus: the twin, or the real one. It learns from a person with a gamepad,
or, on a twin, from a scripted teacher until the novice is proven (--proof). What it learns goes into the --run folder:
labels.lira (every label), novice.safetensors (for `lira drive`), run.jsonl.

examples:
  lira fusion --method plus --run runs/mine            learn from a person
  lira fusion --method lira --teacher scripted --run runs/taught
  lira fusion --method lira --experts corridor         in a real corridor
  lira fusion --method lira --expert mylab.experts:wall --teacher scripted   with a third expert of your own
  lira fusion --method mylab.methods:Mine --teacher scripted                 by a method of your own
"""

import argparse
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.tools.launch.lifetime import CLOSE_S
from lira.tools.options import (
    DEFAULT,
    add_arena,
    add_client,
    add_expert,
    add_layout,
    add_pair,
    add_paused,
    add_protocol,
    add_record,
    add_seed,
    add_shield,
    natural,
)

if TYPE_CHECKING:
    from lira.hal.client.remote import RemoteRobot
    from lira.tools.runs.plan import Plan


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments: which robot, what learns, and how is taught."""
    add_client(parser)
    parser.add_argument(
        "--method",
        required=True,
        help="learn by this method: plus, hold (LIRA-SPF), thesis, hg-dagger, ..., or your own MODULE:OBJECT; "
        "an unknown name lists them all",
    )
    add_pair(parser)
    add_expert(parser)
    add_shield(parser, "what drives unseen layouts")
    add_teaching(parser)
    add_layout(parser, "layout to learn on, and to reset a twin to")
    add_seed(parser, "seeds teacher and training")
    add = parser.add_argument
    add("--run", type=Path, metavar="DIR", help="folder for what is learned (default: runs/<method>)")
    add_record(parser)
    add("--as-command", help=argparse.SUPPRESS)  # what a report shows as the command that repeats the run


def add_teaching(parser: argparse.ArgumentParser) -> None:
    """Declare how is taught, and by whom."""
    add = parser.add_argument
    add("--start", choices=("human", "experts"), help="LIRA-SPF: who drives before the first training step")
    add(
        "--idle-frames",
        choices=("label", "skip"),
        default="label",
        help=f"steps with the dead-man held and the stick at rest: labels as all others, or none {DEFAULT}",
    )
    add(
        "--teacher",
        choices=("none", "scripted", "perfect", "unskilled"),
        default="none",
        help="who helps: a person with a gamepad (none), or on a twin a script with few, no or many human faults",
    )
    add_paused(parser)
    add_arena(parser)
    add("--train-laps", type=natural, default=12, help=f"scripted teacher: give up after so many laps {DEFAULT}")
    add_protocol(parser)
    add(
        "--unseen",
        type=natural,
        default=0,
        help=f"(then) drive so many layouts alone, those after --layout {DEFAULT}",
    )


def run(args: argparse.Namespace) -> int:
    """Learn until done or told to stop. Exit status 1 if the novice did not drive alone as it should."""
    from lira.fusion.inference.threads import one_thread
    from lira.hal.client.connect import connect
    from lira.tools.cli import require

    plan = plan_of(args)
    require(*plan.preset.packages)
    if not plan.preset.approach.learns and args.teacher == "none":
        raise ConfigError(f"by the method '{args.method}' nobody learns", "Show it on a twin with --teacher perfect.")
    one_thread()
    with connect(args.connect, args.name, close_s=CLOSE_S) as robot:
        if args.teacher == "none":
            return learn_by_hand(args, plan, robot)
        from lira.tools.output.say import say
        from lira.tools.runs.remote.on_twin import teach
        from lira.tools.runs.remote.reach import reports_of

        return teach(args, plan, robot, reports_of(robot), say)


def learn_by_hand(args: argparse.Namespace, plan: "Plan", robot: "RemoteRobot") -> int:
    """Learn from whoever takes control."""
    from lira.fusion.learning.trainer import ProcessTrainer
    from lira.tools.output.say import say
    from lira.tools.runs.remote.reach import reports_of
    from lira.tools.runs.remote.with_person import learn_from_person

    return learn_from_person(args, plan, robot, ProcessTrainer, reports_of(robot), say)


def plan_of(args: argparse.Namespace) -> "Plan":
    """Return what the arguments ask to be taught. Raises `ConfigError`, and `PluginError` for somebody's own method."""
    from lira.fusion.experts.load import check_named
    from lira.fusion.methods.presets import file_name, method_named
    from lira.tools.output.places import check_folder
    from lira.tools.runs.plan import Plan

    folder = args.run or Path("runs") / file_name(args.method)
    check_folder(folder)
    check_named(args.expert, args.experts)
    return Plan(
        method_named(args.method).taught(
            start=args.start, layouts=args.layouts, proof=args.proof, idle_frames=args.idle_frames
        ),
        layout=args.layout,
        seed=args.seed,
        laps=args.train_laps,
        unseen=args.unseen,
        teacher=args.teacher,
        pair=args.experts,
        more=args.expert,
        folder=folder,
        shield=args.shield,
        command=args.as_command or shlex.join(["lira", *sys.argv[1:]]),
    )
