"""Train one of the two single-sensor experts with HG-DAgger in the digital twin (thesis, appendix E.1).

The scripted teacher drives whenever the young expert would err; only what the teacher drives is learned. Training
ends when the expert alone passes all drives of its curriculum. The experts that come with the project were made by
this command with its defaults.

examples:
  lira train-expert camera
  lira train-expert lidar --seed 3 --out my-lidar.safetensors
"""

import argparse
from pathlib import Path

from hal.errors import LiraError, StorageError
from tools.arguments import natural


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("expert", choices=["camera", "lidar"], help="which sensor it sees")
    parser.add_argument("--profile", default="thesis-sim", help="robot profile (default: %(default)s)")
    parser.add_argument("--seed", type=natural, default=0, help="seed of everything random (default: %(default)s)")
    parser.add_argument("--out", type=Path, help="checkpoint to write (default: the one that comes with the project)")


def run(args: argparse.Namespace) -> int:
    """Train, measure the cruise action, save. Exit status 1 if the expert did not pass its curriculum."""
    from fusion.expert_files import shipped_path
    from hal.profile import load_profile
    from tools.training import train_expert

    profile = load_profile(args.profile)
    path = args.out or shipped_path(args.expert, profile)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}", "Choose another folder.") from error
    command = f"lira train-expert {args.expert} --profile {args.profile} --seed {args.seed}"
    passed = train_expert(args.expert, profile, args.seed, path, command)
    if not passed:
        raise LiraError("the expert did not pass its curriculum; nothing was saved", "Try another --seed.")
    return 0
