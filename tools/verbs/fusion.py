"""The learner: reads the robot's sensors, decides five times a second, drives, and learns from whoever helps.

It drives whatever robot has that name on the bus: the twin, or the real one. With --policy it only drives; on a twin,
with --unseen, through so many layouts, and says how each went. With --method it learns: from a person with a gamepad,
or, on a twin, from a scripted teacher until the novice is proven (--proof). What it learns goes into the --run folder:
labels.lira (every label), novice.safetensors, run.jsonl.

examples:
  lira fusion --policy camera-expert                   let one expert drive
  lira fusion --policy runs/demo-1/novice.safetensors  let a trained novice drive
  lira fusion --policy runs/demo-1/novice.safetensors --layout 100 --unseen 3   through layouts 101 to 103 of a twin
  lira fusion --policy runs/demo-1/novice.safetensors --ask    which stops and calls where it does not know
  lira fusion --method plus --run runs/mine            learn from a person
  lira fusion --method lira --teacher scripted --run runs/taught
  lira fusion --method lira --experts corridor         in a real corridor
  lira fusion --method lira --expert mylab.experts:wall --teacher scripted   with a third expert of your own
  lira fusion --method mylab.methods:Mine --teacher scripted                 by a method of your own
"""

import argparse
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from lira.fusion.experts.tasks import TASKS
from lira.hal.errors import ConfigError
from lira.tools.launch.lifetime import CLOSE_S
from lira.tools.options import DEFAULT, add_client, add_expert, add_layout, add_protocol, add_seed, natural

if TYPE_CHECKING:
    from lira.hal.client.remote import RemoteRobot
    from lira.hal.messages import Decision
    from lira.tools.runs.teach import Plan


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments: which robot, who drives, and how is taught."""
    add_client(parser)
    add_driver(parser)
    add_teaching(parser)
    add_layout(parser, "layout to learn on, and to reset a twin to")
    add_seed(parser, "seeds teacher and training")
    add = parser.add_argument
    add("--run", type=Path, metavar="DIR", help="folder for what is learned (default: runs/<method>)")
    add("--as-command", help=argparse.SUPPRESS)  # what a report shows as the command that repeats the run


def add_driver(parser: argparse.ArgumentParser) -> None:
    """Declare who drives: a policy, or a method that learns."""
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "--policy",
        help="drive only: camera-expert, lidar-expert, a .safetensors file, or your own MODULE:OBJECT",
    )
    what.add_argument(
        "--method",
        help="learn by this method: plus, hold (LIRA-SPF), thesis, hg-dagger, ..., or your own MODULE:OBJECT; "
        "an unknown name lists them all",
    )
    parser.add_argument(
        "--ask",
        action="store_true",
        help="with --policy: a novice of plus stands and calls where it knows less than in the runs that proved it",
    )
    parser.add_argument(
        "--shield",
        action="store_true",
        help="what drives alone (--policy, --unseen): a turn that would touch what the lidar sees gives way to the "
        "nearest one that does not",
    )
    parser.add_argument(
        "--experts",
        metavar="PAIR",
        help=f"whose experts: a task ({', '.join(TASKS)}), TASK@SEED, or a folder with camera.safetensors and "
        "lidar.safetensors (default: those of a twin's world; line)",
    )
    add_expert(parser)


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
    add(
        "--arena",
        metavar="HOST:PORT",
        help="scripted teacher of a robot on a twin's devices: where that twin tells the truth (its --arena)",
    )
    add("--train-laps", type=natural, default=12, help=f"scripted teacher: give up after so many laps {DEFAULT}")
    add_protocol(parser)
    add(
        "--unseen",
        type=natural,
        default=0,
        help=f"(then) drive so many layouts alone, those after --layout {DEFAULT}",
    )


def run(args: argparse.Namespace) -> int:
    """Drive until done or told to stop. Exit status 1 if the novice or the policy did not drive alone as it should."""
    import torch

    from lira.hal.client.remote import connect

    plan = None if args.method is None else plan_of(args)
    if plan is None and args.expert:
        raise ConfigError("--expert goes with --method", "A policy of your own drives with --policy.")
    if plan is not None and not plan.preset.approach.learns and args.teacher == "none":
        raise ConfigError(f"by the method '{args.method}' nobody learns", "Show it on a twin with --teacher perfect.")
    if args.ask and args.policy is None:
        raise ConfigError("--ask is for a policy that drives", "Give one with --policy, or leave --ask out.")
    torch.set_num_threads(1)  # the nets are small; and a result should not depend on the number of cores
    with connect(args.connect, args.name, close_s=CLOSE_S) as robot:
        if plan is None:
            return show(args, robot)
        if args.teacher == "none":
            return learn_by_hand(args, plan, robot)
        from lira.tools.runs.on_twin import teach

        return teach(args, plan, robot, publisher(robot), say)


def show(args: argparse.Namespace, robot: "RemoteRobot") -> int:
    """Let a policy drive: through unseen layouts of a twin if it is asked to, else until it is told to stop."""
    if args.unseen:
        from lira.tools.runs.on_twin import examine

        return examine(args, robot, publisher(robot), say)
    from lira.tools.runs.with_person import show_policy

    return show_policy(args, robot, publisher(robot), say)


def learn_by_hand(args: argparse.Namespace, plan: "Plan", robot: "RemoteRobot") -> int:
    """Learn from whoever takes control."""
    from lira.fusion.learning.trainer import ProcessTrainer
    from lira.tools.runs.with_person import learn_from_person

    return learn_from_person(args, plan, robot, ProcessTrainer, publisher(robot), say)


def plan_of(args: argparse.Namespace) -> "Plan":
    """Return what the arguments ask to be taught. Raises `ConfigError`, and `PluginError` for somebody's own method."""
    import msgspec

    from lira.fusion.methods.presets import file_name, method_named
    from lira.fusion.methods.syllabus import with_proof
    from lira.tools.runs.teach import Plan

    preset = method_named(args.method)
    if args.start is not None:
        preset = preset.starting(args.start)
    syllabus = preset.syllabus
    if args.layouts is not None:
        syllabus = msgspec.structs.replace(syllabus, layouts=args.layouts)
    if args.proof is not None:
        syllabus = with_proof(syllabus, args.proof)
    learning = msgspec.structs.replace(preset.learning, idle_frames=args.idle_frames)
    return Plan(
        msgspec.structs.replace(preset, learning=learning, syllabus=syllabus),
        layout=args.layout,
        seed=args.seed,
        laps=args.train_laps,
        unseen=args.unseen,
        teacher=args.teacher,
        pair=args.experts,
        more=args.expert,
        folder=args.run or Path("runs") / file_name(args.method),
        shield=args.shield,
        command=args.as_command or shlex.join(["lira", *sys.argv[1:]]),
    )


def publisher(robot: "RemoteRobot") -> Callable[["Decision"], None]:
    """Return what puts decisions on the bus."""
    from lira.hal.bus.topics import DECISION

    topic = robot.bus.publisher(DECISION)
    return lambda decision: topic.put(decision, robot.now())


def say(line: str) -> None:
    """Print a line at once."""
    print(line, flush=True)
