"""Train one of a task's single-sensor experts with HG-DAgger in the digital twin (thesis, appendices E.1, F.1).

The scripted teacher drives whenever the young expert would err; only what the teacher drives is learned. Training
ends when the expert alone passes all drives of its curriculum; those of the line, each lap of which is driven anew, on
other layouts and from other starts, some laps in a row that they were not taught on. One that is not proven within its
laps is not saved.

tasks: line (line-obstacles, race, eight-obstacles), eight, passage, garden, corridor, table-top. The lidar expert of
the eight is the line's, that of the corridor the garden's; table-top has a depth expert, and both others of the line.
Experts of one's own for --experts DIR: --out DIR/camera.safetensors, DIR/lidar.safetensors, one for each sensor.

examples:
  lira train-expert camera
  lira train-expert camera --task passage
  lira train-expert lidar --seed 3 --out my-lidar.safetensors
"""

import argparse
import os
from pathlib import Path

from lira.fusion.experts.tasks import DEFAULT, TASKS
from lira.hal.errors import ConfigError, StorageError
from lira.tools.options import add_seed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    from lira.fusion.experts.files import EXPERTS

    parser.add_argument("expert", choices=EXPERTS, help="which sensor it sees")
    parser.add_argument("--task", choices=TASKS, default=DEFAULT, help="what it is for (default: %(default)s)")
    parser.add_argument("--profile", help="robot profile (default: the task's)")
    add_seed(parser, "seed of everything random")
    parser.add_argument("--out", type=Path, help="checkpoint to write (default: the one that comes with the project)")


def run(args: argparse.Namespace) -> int:
    """Train until it is proven, measure the cruise action, save."""
    from lira.fusion.experts.files import SUFFIX, check_learned, shipped_path
    from lira.fusion.teaching.curriculum import curriculum
    from lira.hal.profile import load_profile
    from lira.tools.runs.expert_training import command, train_expert

    owner = TASKS[args.task].owner(args.expert)
    if owner != args.task:
        what = f"the task '{args.task}' has no {args.expert} expert of its own: it uses that of '{owner}'"
        raise ConfigError(what, f"Train that one with --task {owner}.")
    curriculum(args.expert, args.task)
    profile = load_profile(args.profile or TASKS[args.task].profile)
    check_learned(args.expert, profile)
    path: Path = args.out or shipped_path(args.expert, profile, args.task)
    if path.suffix != SUFFIX:  # by which all that reads it knows it
        raise ConfigError(f"{path} is no {SUFFIX} file", f"Name the checkpoint {path.name or args.expert}{SUFFIX}.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}", "Choose another folder.") from error
    if not os.access(path.parent, os.W_OK):
        raise StorageError(f"cannot write {path}: the folder may not be written", "Choose another folder.")
    how = command(args.expert, args.task, profile, args.seed)
    train_expert(args.expert, args.task, profile, args.seed, path, how)
    return 0
