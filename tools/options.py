"""Types of command-line arguments. What does not fit is refused by argparse, with exit status 2."""

import argparse

from lira.fusion.experts.tasks import TASKS

ENDPOINT = "127.0.0.1:7447"


def natural(text: str) -> int:
    """Read a whole number that is not negative: a seed, a layout, a count."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 0 on")
    return value


def add_robot(parser: argparse.ArgumentParser) -> None:
    """Declare which robot, where it is reached, and whose experts go with it."""
    add = parser.add_argument
    add("--name", default="rosbot", help="the robot's name on the bus (default: %(default)s)")
    add("--connect", default=ENDPOINT, metavar="HOST:PORT", help="where the robot listens (default: %(default)s)")
    add(
        "--arena",
        metavar="HOST:PORT",
        help="where the twin behind a robot tells the truth, if the robot is on that twin's devices (its --arena)",
    )
    add(
        "--experts",
        metavar="PAIR",
        help=f"whose experts: a task ({', '.join(TASKS)}), TASK@SEED, or a folder with camera.safetensors and "
        "lidar.safetensors (default: those of a twin's world; line)",
    )


def add_shield(parser: argparse.ArgumentParser, who: str) -> None:
    """Declare whether somebody drives behind a shield."""
    parser.add_argument(
        "--shield",
        action="store_true",
        help=f"{who}: a turn that would touch what the lidar sees gives way to the nearest one that does not",
    )


def add_protocol(parser: argparse.ArgumentParser, layouts: str | None = None, proof: str | None = None) -> None:
    """Declare on which layouts is taught and what counts as proof; None: as the method says."""
    usual = "as the method does" if layouts is None else "%(default)s"
    parser.add_argument(
        "--layouts",
        choices=("own", "fresh"),
        default=layouts,
        help=f"training laps: all on --layout (own), or each on another (fresh; default: {usual})",
    )
    parser.add_argument(
        "--proof",
        metavar="own|fresh:K",
        default=proof,
        help="what ends the teaching: the novice alone passes the lap it was just taught on (own), K layouts in a row "
        f"that it has never seen (fresh:K), or K of N (fresh:K/N; default: {usual})",
    )
