"""Teach the robot yourself, with an end: practise, demonstrate, help where it errs, have it proven, and get a verdict.

Without --connect it starts a twin. Drive it from a gamepad (`lira joystick`), the keyboard (`lira console`) or a page
(`lira web`), each in a shell of its own: they tell what to do at every moment. A lap that passes without your help is
followed by the proof: the novice alone, here and on layouts that it has not seen. Ask for it sooner by V, or cross on
the pad. On a real robot you judge: passed, failed, or take over. U takes the labels of your last intervention back.

examples:
  lira teach --as ada                                  on a twin; then, in another shell: lira web
  lira teach --as ada --speed 0.5                      slower than real time, for the first time
  lira teach --as ada --run runs/teach-ada             go on another day: labels and counts go on
  lira teach --connect 192.168.1.20:7447 --as ada      a robot that is there
  lira teach --world line-obstacles --person scripted  a script drives by teleop as a hand would, at twice real time

exit status: 0 if the newest proof was passed, or none was asked for; 1 if it was not; 2 if something went wrong
"""

import argparse
import contextlib
import re
import shlex
import sys
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.bus.endpoint import DEFAULT_ENDPOINT, DEFAULT_ROBOT
from lira.hal.errors import ConfigError
from lira.tools.options import DEFAULT, add_expert, add_layout, add_record, add_seed, natural

if TYPE_CHECKING:
    from lira.tools.runs.plan import Plan

SCRIPT_SPEED = 2.0
LAPS, SCRIPT_LAPS = 100, 10
SLOWEST, FASTEST = 0.4, 5.0  # of a person's; slower, a screen would take what the twin says for old
READY_S = 90.0
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")


def person_name(text: str) -> str:
    """Read a name that may be a part of a folder's name."""
    if NAME.fullmatch(text) is None:
        raise argparse.ArgumentTypeError(f"'{text}' is no name: letters, digits, - and _, at most 32")
    return text


def _speed(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not SLOWEST <= value <= FASTEST:
        raise argparse.ArgumentTypeError(f"'{text}' is no speed: {SLOWEST:g} to {FASTEST:g}")
    return value


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--as", dest="who", type=person_name, default="you", metavar="NAME", help=f"who teaches {DEFAULT}")
    add("--world", default="line-obstacles", help=f"the twin's world by name or .toml file {DEFAULT}")
    add("--profile", help="the twin's robot (default: that of the world's experiment)")
    add("--connect", metavar="HOST:PORT", help="teach the robot or the twin that is there, instead of starting a twin")
    add("--name", default=DEFAULT_ROBOT, help=f"the robot's name on the bus {DEFAULT}")
    add("--listen", default=DEFAULT_ENDPOINT, metavar="HOST:PORT", help=f"where the twin listens {DEFAULT}")
    add("--speed", type=_speed, help="of the twin, times real time (default: 1; with a scripted person 2)")
    add("--method", default="plus", help=f"way of teaching, as in `lira fusion` {DEFAULT}")
    add("--practice", type=float, metavar="S", help="seconds of driving before it counts (default: 15, scripted: 2)")
    add("--unseen", type=natural, default=12, help=f"layouts that the novice has not seen, to prove itself {DEFAULT}")
    add("--laps", type=natural, help="end after so many laps of teaching (default: 100, scripted: 10)")
    add("--minutes", type=float, metavar="M", help="end after so many minutes of teaching (default: when you end it)")
    add("--whole-time", action="store_true", help="with --minutes: go on though the novice has passed")
    add("--idle-frames", choices=("label", "skip"), default="skip", help=f"steps with the stick at rest {DEFAULT}")
    add("--experts", metavar="PAIR", help="whose experts, as in `lira fusion`")
    add_expert(parser)
    add_layout(parser, "layout to teach on")
    add_seed(parser, "seeds training, and the script's faults")
    add(
        "--person",
        choices=("hand", "scripted", "perfect", "unskilled"),
        default="hand",
        help="who drives: a hand, or on a twin a script with few, no or many human faults (for tests)",
    )
    add("--shown-as", default="", help=argparse.SUPPRESS)  # in a study: the letter of a method that is not to be known
    add("--run", type=Path, metavar="DIR", help="folder of the session; one that is there goes on (default: a new one)")
    add_record(parser)


def run(args: argparse.Namespace) -> int:
    """Hold the session, and leave a report."""
    from lira.fusion.inference.threads import one_thread
    from lira.hal.client.connect import connect
    from lira.tools.cli import require
    from lira.tools.launch.lifetime import CLOSE_S
    from lira.tools.live.rules import Rules
    from lira.tools.live.sitting import sit
    from lira.tools.output.say import say

    scripted = args.person != "hand"
    args.run = args.run or Path("runs") / f"teach-{args.who}-{datetime.now():%Y%m%d-%H%M%S}"
    args.laps = args.laps or (SCRIPT_LAPS if scripted else LAPS)
    plan = plan_of(args)
    require(*plan.preset.packages)
    one_thread()
    args.speed = args.speed or (SCRIPT_SPEED if scripted else 1.0)
    practice_s = args.practice if args.practice is not None else 2.0 if scripted else 15.0
    rules = Rules(practice_s, args.who, args.laps, args.minutes, args.whole_time, args.unseen)
    with contextlib.ExitStack() as stack:
        stack.enter_context(robot_of(args))
        robot = stack.enter_context(connect(args.connect, args.name, close_s=CLOSE_S))
        if scripted:
            stack.enter_context(script_of(args))
        else:
            say(f"drive '{args.name}' at {args.connect} with lira web, lira console or lira joystick")
        outcome = sit(args, plan, robot, rules, say)
    return conclude(args.run, outcome.passed, args.shown_as)


def plan_of(args: argparse.Namespace) -> "Plan":
    """What is taught, and how. Raises `ConfigError` for what cannot be, before anything starts."""
    from lira.fusion.experts.load import check_named
    from lira.fusion.methods.presets import method_named
    from lira.tools.output.places import check_folder
    from lira.tools.runs.plan import Plan

    check_folder(args.run)
    check_named(args.expert, args.experts)
    preset = method_named(args.method)
    if not preset.approach.learns:
        raise ConfigError(f"by the method '{args.method}' nobody learns", "Choose another --method.")
    return Plan(
        # A person learns one course by heart; what the novice has not seen comes in the proof.
        preset.taught(layouts="own", proof="own", idle_frames=args.idle_frames),
        layout=args.layout,
        seed=args.seed,
        laps=args.laps,
        unseen=args.unseen,
        pair=args.experts,
        more=args.expert,
        folder=args.run,
        command=shlex.join(["lira", *sys.argv[1:]]),
    )


@contextlib.contextmanager
def robot_of(args: argparse.Namespace) -> Iterator[None]:
    """The robot that is there, or a twin for as long as the session lasts. Sets `args.connect`, for a script a name."""
    from lira.tools.launch.launch import direct, running, twin_words
    from lira.tools.launch.processes import free_port
    from lira.tools.output.say import say

    if args.connect is not None:
        yield
        return
    if args.person != "hand":
        args.listen = f"127.0.0.1:{free_port()}"
        args.name = f"taught_{args.listen.rpartition(':')[2]}"
    twin = twin_words(args.world, args.profile, args.seed)
    twin += ["--layout", str(args.layout), "--speed", str(args.speed)]
    args.connect = args.listen
    with running(direct(args.name, args.listen, twin, lockstep=False), args.run, say):
        yield


@contextlib.contextmanager
def script_of(args: argparse.Namespace) -> Iterator[None]:
    """A scripted person who drives over teleop."""
    from lira.tools.launch.processes import ChildProcess
    from lira.tools.live import scripted_person

    words = [args.name, args.connect, args.world, args.layout, args.speed, args.person, args.seed]
    command = [sys.executable, "-m", "lira.tools.live.scripted_person", *map(str, words)]
    with ChildProcess("the scripted person", command, args.run / "person.log") as child:
        child.wait_ready(scripted_person.READY, READY_S)
        yield


def conclude(folder: Path, passed: bool | None, shown_as: str) -> int:
    """Write the report, and say where it is and what to do with it."""
    from lira.tools.output.label_words import learned_words
    from lira.tools.output.table import format_table
    from lira.tools.report import write_report
    from lira.tools.report.digest import load_run
    from lira.tools.report.laps import COLUMNS, lap_cells
    from lira.tools.runs.names import RECORD

    recorded = load_run(folder / RECORD)
    print(f"\n{format_table(COLUMNS, [lap_cells(lap) for lap in recorded.laps])}\n")
    if recorded.result is not None:
        print(learned_words(recorded.result))
    if recorded.verdict is not None:
        print(f"{recorded.verdict.words}.")
    print(f"report: {write_report(folder, shown_as)}")
    if not shown_as:
        print(f"go on another day: lira teach --run {shlex.quote(str(folder))}")
    return 1 if passed is False else 0
