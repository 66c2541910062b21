"""Start all that a robot needs, and keep it running: a twin or, with --robot, the link to a real one, and around it the
learner, the recorder, the page in the browser, the gamepad and the monitor. It returns when all of it runs, and the
processes stay.

Nothing drives by itself: the learner or the driver begins paused, and a person asks it to go on (P on a screen, square
on the pad). What dies is started again after a pause, and begins paused again. `lira status`, `lira logs` and
`lira down` are the rest of its life.

examples:
  lira up                                          a twin in the line world, taught on the page
  lira up --world line-obstacles --method hold
  lira up --robot 192.168.1.20                     a real robot, which runs `lira robot` itself
  lira up --policy runs/demo-1/novice.safetensors  a novice drives instead of being taught
  lira up --set look --without pad                 only look at it
  lira up --name second                            one more beside it
  lira up --stay                                   stay in this terminal, or be a container's command

exit status: 0 when all of it runs, also if it did before; 1 if something else is up under that name
"""

import argparse
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.bus.endpoint import DEFAULT_ENDPOINT, DEFAULT_ROBOT
from lira.hal.errors import ConfigError, MissingExtraError
from lira.tools.options import DEFAULT, add_layout, add_seed

if TYPE_CHECKING:
    from lira.tools.lifecycle.setup import Setup

SETS = ("teach", "drive", "look")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--name", default=DEFAULT_ROBOT, help=f"the robot's name on the bus {DEFAULT}")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--robot", metavar="HOST[:PORT]", help="a real robot that listens there, instead of a twin")
    where.add_argument("--world", help="the twin's world by name or .toml file (default: line)")
    add("--profile", help="the twin's robot (default: that of the world's experiment)")
    add("--listen", metavar="HOST:PORT", help=f"where the twin listens (default: {DEFAULT_ENDPOINT} or the next free)")
    add_layout(parser, "the twin's layout")
    add_seed(parser, "seeds the twin's noise")
    add(
        "--set",
        choices=SETS,
        help="which processes: a learner, a driver or neither (default: teach; with --policy drive)",
    )
    add("--without", action="append", default=[], metavar="PROCESS", help="leave one out; may be given several times")
    add("--method", default="plus", help=f"way of teaching, as in `lira fusion` {DEFAULT}")
    add("--policy", metavar="POLICY", help="what drives, as in `lira drive`")
    add("--run", type=Path, metavar="DIR", help="folder for what is learned (default: runs/<method>-<world or name>)")
    add("--page-port", type=int, metavar="PORT", help="of the page in the browser (default: 8080 or the next free)")
    add("--stay", action="store_true", help="do not leave: Ctrl-C takes all of it down")


def run(args: argparse.Namespace) -> int:
    """Bring it up, or say what is up already."""
    import time

    from lira.tools.lifecycle.control import bring_up, supervise
    from lira.tools.lifecycle.status import as_text, look

    before = look(args.name, time.monotonic())
    if before.state is not None:
        same = before.state.setup == setup_of(args, taken=before.state.setup)
        print(f"already up{'' if same else ', as something else (lira down ends it)'}:\n\n{as_text(before)}")
        return 0 if same else 1
    setup = setup_of(args)
    check(setup)
    if args.stay:
        supervise(setup, say)
        return 0
    bring_up(setup, say)
    page = f"; teach and drive it at http://127.0.0.1:{setup.page_port}" if "page" in setup.processes else ""
    say(f"up: {setup.where}{page}")
    return 0


def setup_of(args: argparse.Namespace, taken: "Setup | None" = None) -> "Setup":
    """What is asked for. Raises `ConfigError`. `taken` is what is up already: it keeps its ports."""
    from lira.tools.launch.launch import twin_words
    from lira.tools.lifecycle.ports import free_from
    from lira.tools.lifecycle.setup import PAGE_PORT, PORT, Setup, endpoint_of, run_folder
    from lira.tools.lifecycle.table import chosen

    chosen_set = args.set or ("teach" if args.policy is None else "drive")
    if (chosen_set == "drive") != (args.policy is not None):
        raise ConfigError("--set drive goes with --policy", "Say what drives, for example: --policy camera-expert.")
    if args.robot is not None and (args.profile or args.listen):
        raise ConfigError("--profile and --listen are the twin's", "A real robot has its own: leave them out.")
    world = "" if args.robot is not None else args.world or "line"
    page_port = args.page_port or (taken.page_port if taken is not None else free_from(PAGE_PORT))
    if args.robot is not None:
        endpoint = endpoint_of(args.robot)
    else:
        endpoint = args.listen or (taken.endpoint if taken is not None else f"127.0.0.1:{free_from(PORT)}")
    folder = args.run or run_folder(args.name, args.method, world)
    return Setup(
        name=args.name,
        endpoint=endpoint,
        processes=chosen(chosen_set, twin=args.robot is None, without=args.without),
        world=world,
        twin=() if args.robot is not None else tuple(twin_words(world, args.profile, args.seed)),
        layout=args.layout,
        method=args.method,
        policy=args.policy or "",
        folder=str(folder.resolve()),
        page_port=page_port,
    )


def check(setup: "Setup") -> None:
    """Refuse what cannot work before anything starts. Raises `ConfigError` and `MissingExtraError`."""
    from lira.tools.cli import EXTRAS
    from lira.tools.lifecycle.table import rows

    for process in rows(setup):
        for package in process.packages:
            if find_spec(package) is None:
                raise MissingExtraError(package, EXTRAS[package])
    if "learner" in setup.processes:
        from lira.fusion.methods.presets import method_named

        if not method_named(setup.method).approach.learns:
            raise ConfigError(f"by the method '{setup.method}' nobody learns", "Choose another --method.")


def say(words: str) -> None:
    """Print a line at once."""
    print(words, flush=True)
