"""Put a robot's processes under systemd, so that they run from the start of the machine: the laptop's, or the robot's.

`lira deploy laptop` takes the words of `lira up` and makes a user unit of each process, in the environment that runs
now. `lira deploy robot` does the same for `lira robot` (its words come after --), here or by ssh on the robot's
computer, with an environment of its own there made from wheels. --dry-run shows units, keys and settings, and asks no
machine for anything; --remove undoes it all. Whatever drives begins paused, at every start.

examples:
  lira deploy laptop --dry-run
  lira deploy laptop --robot 192.168.1.20 --keys keys/laptop
  lira deploy robot --host husarion@rosbot --keys keys/robot -- --base /dev/core2 --lidar /dev/rplidar --camera openni:
  lira deploy robot --host husarion@rosbot --remove
"""

import argparse
import sys
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.bus.endpoint import DEFAULT_ENDPOINT, DEFAULT_ROBOT
from lira.hal.errors import ConfigError, MissingExtraError
from lira.tools.lifecycle.arguments import add_setup
from lira.tools.options import DEFAULT

if TYPE_CHECKING:
    from lira.tools.deploy.plan import Plan
    from lira.tools.deploy.target import Facts, Target
    from lira.tools.lifecycle.setup import Setup

EVERYWHERE = "0.0.0.0:7447"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    machines = parser.add_subparsers(dest="machine", required=True, metavar="MACHINE")
    laptop = machines.add_parser("laptop", help="what runs beside the robot, on this machine", allow_abbrev=False)
    robot = machines.add_parser(
        "robot",
        help="the robot's own side, on its computer",
        epilog="Words for `lira robot` go after --, as in: lira deploy robot --host pi@rover -- --base /dev/core2 ...",
        allow_abbrev=False,
    )
    add_setup(laptop)
    laptop.add_argument("--record", action="store_true", help="record always, too: mind the disk")
    add = robot.add_argument
    add("--host", metavar="USER@HOST", help="the robot's computer, by ssh and a key (default: this machine)")
    add("--ssh-config", type=Path, metavar="FILE", help="a file for ssh: port, key, and so on")
    add("--name", default=DEFAULT_ROBOT, help=f"the robot's name on the bus {DEFAULT}")
    add(
        "--listen",
        metavar="HOST:PORT",
        help=f"where it listens (default: {EVERYWHERE} with keys, else {DEFAULT_ENDPOINT})",
    )
    add("--wheels", type=Path, metavar="DIR", help="wheels to install there (default: one built from this checkout)")
    add("--offline", action="store_true", help="install from these wheels alone: the robot reaches no package index")
    add("--python", default="python3", metavar="NAME", help=f"Python there that makes its environment {DEFAULT}")
    add("words", nargs="*", metavar="-- WORDS", help="after --, words for `lira robot`: --base, --lidar, --camera, ...")
    for machine in (laptop, robot):
        add = machine.add_argument
        add("--keys", type=Path, metavar="DIR", help="bundle of keys for it (lira keys)")
        add("--dry-run", action="store_true", help="show all of it, change nothing, and ask no machine anything")
        add("--remove", action="store_true", help="undo it: stop, and delete what was written")


def run(args: argparse.Namespace) -> int:
    """Show the plan, do it, or undo it."""
    from lira.tools.deploy.plan import removal
    from lira.tools.deploy.target import Target

    target = Target(args.host, args.ssh_config) if args.machine == "robot" else Target()
    if args.remove:
        script = removal(_checked(args.name))
        print(script if args.dry_run else target.run(script))
        return 0
    plan, facts = laptop_plan(args, target) if args.machine == "laptop" else robot_plan(args, target)
    if args.dry_run:
        print(f"on {target.where}, in the home folder of its user (supposed: {facts.words}):\n")
        print(plan.shown(list(facts.before)))
        return 0
    print(target.put(plan, facts))
    if plan.notes:
        print("\n".join(["yourself, once:", *plan.notes]))
    return 0


def laptop_plan(args: argparse.Namespace, target: "Target") -> tuple["Plan", "Facts"]:
    """What runs beside the robot. Raises `ConfigError` and `MissingExtraError`."""
    from lira.tools.deploy.plans import for_laptop
    from lira.tools.lifecycle.arguments import Ports, check_method, check_packages, check_policy, setup_of

    # A unit has a folder of its own: what is a file here keeps its whole path.
    for name in ("world", "profile", "policy"):
        value = getattr(args, name)
        if value is not None and Path(value).is_file():
            setattr(args, name, str(Path(value).resolve()))
    if not args.record and args.set != "look":
        args.without.append("recorder")
    setup = setup_of(args, Ports())
    with suppress(MissingExtraError, ModuleNotFoundError) if args.dry_run else nullcontext():
        check_packages(setup)
        check_method(setup)
        check_policy(setup)
    facts = target.suppose(setup.name) if args.dry_run else target.look(setup.name)
    return for_laptop(setup, facts, sys.executable, Path.cwd(), args.keys), facts


def robot_plan(args: argparse.Namespace, target: "Target") -> tuple["Plan", "Facts"]:
    """What runs on the robot. Raises `ConfigError`."""
    from lira.tools.deploy.packages import collect
    from lira.tools.deploy.plans import for_robot

    setup, python3 = robot_setup(args), args.python
    facts = target.suppose(setup.name) if args.dry_run else target.look(setup.name, python3)
    brought = collect(args.wheels, setup.name, build=not args.dry_run)
    return for_robot(setup, facts, brought, args.keys, python3=python3, offline=args.offline), facts


def robot_setup(args: argparse.Namespace) -> "Setup":
    """The robot's set-up, its words read as its verb reads them. Raises `ConfigError`."""
    from lira.tools.cli import Parser
    from lira.tools.lifecycle.setup import Setup
    from lira.tools.verbs.robots import robot

    if not args.words:
        raise ConfigError("no words for `lira robot`", "Give them after --, as in: -- --base /dev/core2 ...")
    parser = Parser(prog="lira deploy robot --", allow_abbrev=False)
    robot.add_arguments(parser)
    robot.check_devices(parser.parse_args(args.words))
    listen = args.listen or (DEFAULT_ENDPOINT if args.keys is None else EVERYWHERE)
    if any(word in args.words for word in ("--name", "--listen")):
        raise ConfigError("--name and --listen stand before the --", "Give them to `lira deploy robot` itself.")
    return Setup(name=_checked(args.name), endpoint=listen, processes=("robot",), robot=tuple(args.words))


def _checked(name: str) -> str:
    from lira.hal.bus.endpoint import check_name

    check_name(name)
    return name
