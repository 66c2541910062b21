"""The words by which `lira up` and `lira deploy laptop` are told what shall run, and the set-up that they mean."""

import argparse
from pathlib import Path
from typing import NamedTuple

from lira.hal.bus.endpoint import DEFAULT_ENDPOINT, DEFAULT_ROBOT
from lira.hal.errors import ConfigError
from lira.tools.lifecycle.setup import PAGE_PORT, PORT, Setup, endpoint_of, run_folder
from lira.tools.lifecycle.table import SETS, chosen, rows
from lira.tools.options import DEFAULT, add_layout, add_seed
from lira.tools.output.places import check_folder

WORLD = "line"


class Ports(NamedTuple):
    """Where a twin and a page listen unless somebody says where."""

    twin: int = PORT
    page: int = PAGE_PORT


def add_setup(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    add = parser.add_argument
    add("--name", default=DEFAULT_ROBOT, help=f"the robot's name on the bus {DEFAULT}")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--robot", metavar="HOST[:PORT]", help="a real robot that listens there, instead of a twin")
    where.add_argument("--world", help=f"the twin's world by name or .toml file (default: {WORLD})")
    add("--profile", help="the twin's robot (default: that of the world's experiment)")
    add("--listen", metavar="HOST:PORT", help=f"where the twin listens (default: {DEFAULT_ENDPOINT})")
    add_layout(parser, "the twin's layout")
    add_seed(parser, "seeds the twin's noise")
    add("--set", choices=tuple(SETS), help="a learner, a driver or neither (default: teach; drive with --policy)")
    add("--without", action="append", default=[], metavar="PROCESS", help="leave one out; may be given several times")
    add("--method", default="plus", help=f"way of teaching, as in `lira fusion` {DEFAULT}")
    add("--policy", metavar="POLICY", help="what drives, as in `lira drive`")
    add(
        "--run",
        type=Path,
        metavar="DIR",
        help="folder for what is learned and recorded (default: in runs/, by method and world)",
    )
    add("--page-port", type=int, metavar="PORT", help=f"of the page in the browser (default: {PAGE_PORT})")


def setup_of(args: argparse.Namespace, ports: Ports) -> Setup:
    """What they ask for. Raises `ConfigError` for what does not go together, and for what there is none of."""
    from lira.tools.launch.launch import twin_words

    chosen_set = args.set or ("teach" if args.policy is None else "drive")
    if (chosen_set == "drive") != (args.policy is not None):
        raise ConfigError("--set drive goes with --policy", "Say what drives, for example: --policy camera-expert.")
    if args.robot is not None and (args.profile or args.listen):
        raise ConfigError("--profile and --listen are the twin's", "A real robot has its own: leave them out.")
    world = "" if args.robot is not None else args.world or WORLD
    folder = args.run or run_folder(args.name, args.method if chosen_set == "teach" else chosen_set, world)
    check_folder(folder)
    return Setup(
        name=args.name,
        endpoint=endpoint_of(args.robot) if args.robot is not None else args.listen or f"127.0.0.1:{ports.twin}",
        processes=chosen(chosen_set, twin=args.robot is None, without=args.without),
        world=world,
        twin=tuple(twin_words(world, args.profile, args.seed)) if world else (),
        layout=args.layout,
        method=args.method,
        policy=args.policy or "",
        folder=str(folder.resolve()),
        page_port=args.page_port or ports.page,
    )


def check_packages(setup: Setup) -> None:
    """Refuse what lacks a package before anything starts. Raises `MissingExtraError`."""
    from lira.tools.cli import require

    for process in rows(setup):
        require(*process.packages)


def check_method(setup: Setup) -> None:
    """Refuse a method by which nobody learns, or that lacks a package. Raises `ConfigError`, `MissingExtraError`."""
    if "learner" in setup.processes:
        from lira.fusion.methods.presets import method_named
        from lira.tools.cli import require

        preset = method_named(setup.method)
        require(*preset.packages)
        if not preset.approach.learns:
            raise ConfigError(f"by the method '{setup.method}' nobody learns", "Choose another --method.")


def check_policy(setup: Setup) -> None:
    """Refuse a policy that there is not. It loads what drives. Raises `ConfigError`, `StorageError`, `PluginError`."""
    if setup.policy:
        from lira.fusion.experts.load import check_named

        check_named([setup.policy])
