"""Train one of a task's single-sensor experts with HG-DAgger in the digital twin (thesis, appendices E.1, F.1).

The scripted teacher drives whenever the young expert would err; only what the teacher drives is learned. Training
ends when the expert alone passes all drives of its curriculum. The experts that come with the project were made by
this command with its defaults.

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
from lira.hal.errors import ConfigError, LiraError, StorageError
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
    """Train, measure the cruise action, save. Exit status 1 if the expert did not pass its curriculum."""
    from lira.fusion.experts.files import shipped_path
    from lira.hal.profile import load_profile
    from lira.tools.runs.expert_training import command, train_expert

    owner = TASKS[args.task].owner(args.expert)
    if owner != args.task:
        what = f"the task '{args.task}' has no {args.expert} expert of its own: it uses that of '{owner}'"
        raise ConfigError(what, f"Train that one with --task {owner}.")
    profile = load_profile(args.profile or TASKS[args.task].profile)
    path = args.out or shipped_path(args.expert, profile, args.task)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}", "Choose another folder.") from error
    if not os.access(path.parent, os.W_OK):
        raise StorageError(f"cannot write {path}: the folder may not be written", "Choose another folder.")
    how = command(args.expert, args.task, profile, args.seed)
    passed = train_expert(args.expert, args.task, profile, args.seed, path, how)
    if not passed:
        raise LiraError("the expert did not pass its curriculum; nothing was saved", "Try another --seed.")
    return 0
