"""What a learning run leaves in its folder: every label, the record of its steps, and the novice."""

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from lira.fusion.learning.novice import Novice
from lira.fusion.log.run_log import RunRecord
from lira.fusion.methods.presets import method_named
from lira.fusion.operator_service import Job
from lira.fusion.policies.checkpoint import Checkpoint, save_checkpoint
from lira.hal.profile import RobotProfile
from lira.tools.cli import version

LABELS, RECORD, NOVICE = "labels.lira", "run.jsonl", "novice.safetensors"
FLOOR = "floor"  # the world of a robot that is in none of ours


def head(args: argparse.Namespace, profile: RobotProfile, world: str) -> RunRecord:
    """How the run was started, from the arguments of `lira fusion`."""
    method = method_named(args.method)
    return RunRecord(
        world,
        profile.name,
        method.kind,
        method.name,
        args.layout,
        args.seed,
        command(args),
        version(),
        args.idle_frames,
    )


def snapshot(
    folder: Path,
    novice: Novice,
    profile: RobotProfile,
    args: argparse.Namespace,
    sync: Callable[[], None] = lambda: None,
) -> Job:
    """Take what was learned as it is now; what is returned writes it, may run aside, and says what it wrote.

    `sync` makes sure of the labels. The writing raises `StorageError`.
    """
    labels, steps, network = novice.stored, novice.training_steps, novice.frozen()
    doubtful = aside_words(novice.set_aside())
    sizes = profile.features.bins, profile.features.filters
    about = Checkpoint(network.kind, *sizes, profile.name, None, command(args), args.seed)
    about = replace(about, labels=labels, training_steps=steps, examples=network.examples)

    def write() -> str:
        sync()
        if steps == 0:
            return f"saved {labels} labels in {folder}; there is no novice yet"
        save_checkpoint(folder / NOVICE, network, about)
        return f"saved {labels} labels and the novice after {steps} training steps in {folder}{doubtful}"

    return write


def aside_words(labels: Sequence[tuple[int, str]]) -> str:
    """Which labels the novice does not believe, for whoever gave them to look at."""
    if not labels:
        return ""
    names = ", ".join(f"{number} ({source})" for number, source in labels)
    return f"; set aside, since the others contradict them, labels {names}"


def command(args: argparse.Namespace) -> str:
    """Return the command that repeats the run."""
    return str(args.as_command or shlex.join(["lira", *sys.argv[1:]]))
