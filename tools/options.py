"""Arguments that several verbs have, and their types. What does not fit is refused by argparse, with exit status 2."""

import argparse
import os

from lira.fusion.experts.tasks import TASKS
from lira.hal.bus.endpoint import DEFAULT_ENDPOINT, DEFAULT_ROBOT

DEFAULT = "(default: %(default)s)"


def natural(text: str) -> int:
    """Read a whole number that is not negative: a seed, a layout, a count."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 0 on")
    return value


def positive(text: str) -> int:
    """Read a whole number from 1 on: how many of something there shall be."""
    value = int(text) if text.isdecimal() else 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 1 on")
    return value


def port(text: str) -> int:
    """Read a port to serve on; 0 is any that is free."""
    if not text.isdecimal() or not 0 <= int(text) < 65536:
        raise argparse.ArgumentTypeError(f"'{text}' is no port: 0 to 65535")
    return int(text)


def add_client(parser: argparse.ArgumentParser) -> None:
    """Declare which robot on the bus is meant: `--name` and `--connect`."""
    add = parser.add_argument
    add("--name", default=DEFAULT_ROBOT, help=f"the robot's name on the bus {DEFAULT}")
    add("--connect", default=DEFAULT_ENDPOINT, metavar="HOST:PORT", help=f"where the robot listens {DEFAULT}")


def add_server(parser: argparse.ArgumentParser) -> None:
    """Declare as which robot on the bus something is served: `--name`, `--listen` and `--insecure`."""
    add = parser.add_argument
    add("--name", default=DEFAULT_ROBOT, help=f"robot's name: every key on the bus begins with it {DEFAULT}")
    add(
        "--listen",
        default=DEFAULT_ENDPOINT,
        metavar="HOST:PORT",
        help="where drivers connect; 0.0.0.0:7447 lets other machines in (default: %(default)s, this machine only)",
    )
    add("--insecure", action="store_true", help="let other machines in without keys (see lira keys)")


def add_record(parser: argparse.ArgumentParser) -> None:
    """Declare `--no-record`."""
    parser.add_argument(
        "--no-record", action="store_true", help="do not record the bus into the folder of the run (see lira record)"
    )


def add_profile(parser: argparse.ArgumentParser, default: str, what: str = "robot") -> None:
    """Declare `--profile`."""
    parser.add_argument("--profile", default=default, help=f"{what} by name or .toml file {DEFAULT}")


def add_world(parser: argparse.ArgumentParser, default: str, what: str = "world") -> None:
    """Declare `--world`."""
    parser.add_argument("--world", default=default, help=f"{what} by name or .toml file {DEFAULT}")


def add_layout(parser: argparse.ArgumentParser, what: str) -> None:
    """Declare `--layout`."""
    parser.add_argument("--layout", type=natural, default=0, help=f"{what} {DEFAULT}")


def add_randomise(parser: argparse.ArgumentParser, where: str = "") -> None:
    """Declare `--randomise`; `where` that happens."""
    parser.add_argument(
        "--randomise",
        action="store_true",
        help=f"{where}each layout with its own grays, noise, mounting of the camera and slip of the wheels",
    )


def add_seed(parser: argparse.ArgumentParser, what: str) -> None:
    """Declare `--seed`; `what` it decides."""
    parser.add_argument("--seed", type=natural, default=0, help=f"{what} {DEFAULT}")


def add_json(parser: argparse.ArgumentParser) -> None:
    """Declare `--json`, which `lira.tools.output.machine` heeds."""
    parser.add_argument("--json", metavar="FILE", help="write a JSON object to FILE (-: standard output)")


def add_arena(parser: argparse.ArgumentParser) -> None:
    """Declare `--arena`."""
    parser.add_argument(
        "--arena",
        metavar="HOST:PORT",
        help="of a robot on a twin's devices: where that twin tells the truth (its --arena)",
    )


def add_pair(parser: argparse.ArgumentParser) -> None:
    """Declare `--experts`."""
    parser.add_argument(
        "--experts",
        metavar="PAIR",
        help=f"whose experts: a task ({', '.join(TASKS)}), TASK@SEED, or a folder with camera.safetensors and "
        "lidar.safetensors (default: those of a twin's world; line)",
    )


def add_shield(parser: argparse.ArgumentParser, who: str) -> None:
    """Declare `--shield`; `who` drives behind it."""
    parser.add_argument(
        "--shield",
        action="store_true",
        help=f"{who}: a turn that would touch what the lidar sees gives way to the nearest one that does not",
    )


def add_paused(parser: argparse.ArgumentParser) -> None:
    """Declare `--paused`."""
    parser.add_argument(
        "--paused",
        action="store_true",
        help="begin paused: the robot stands until a person asks to go on (P on a screen, square on the pad)",
    )


def add_expert(parser: argparse.ArgumentParser) -> None:
    """Declare `--expert`."""
    parser.add_argument(
        "--expert",
        action="append",
        default=[],
        metavar="MODULE:OBJECT",
        help="beside the pair, an expert of your own: a function of lira.Features; may be given several times",
    )


def add_protocol(
    parser: argparse.ArgumentParser, layouts: str | None = None, usual_proof: str = "as the method does"
) -> None:
    """Declare on which layouts is taught, None: as the method says; and what counts as proof, usually `usual_proof`."""
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
        help="what ends the teaching: the novice alone passes the lap it was just taught on (own), K layouts in a row "
        f"that it has never seen (fresh:K), or K of N (fresh:K/N; default: {usual_proof})",
    )


def add_ros_domain(parser: argparse.ArgumentParser, what: str, name: str = "--domain") -> None:
    """Declare which domain of ROS 2 is meant; unless it is named it is that of ROS_DOMAIN_ID, as in ROS."""
    default = os.environ.get("ROS_DOMAIN_ID") or "0"  # a text is read like one from the command line
    parser.add_argument(name, type=natural, default=default, metavar="N", help=f"{what} {DEFAULT}")
