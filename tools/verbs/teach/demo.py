"""Watch a robot learn: the digital twin and the learner in two processes, over the same bus that drives the real robot.

The experts drive where they agree, a scripted teacher helps where they do not, and a novice that sees both sensors
learns from all of them, each lap on another layout. It is proven when it drives some fresh layouts in a row alone;
after that it is shown more of them. It all takes a minute or two and leaves report.html in the run's folder.

A world for it has boxes: without any the experts never disagree, and nobody is asked.

examples:
  lira demo
  lira demo --seed 3 --unseen 5
  lira demo --world race --laps 20 --run runs/race
  lira demo --world passage
  lira demo --method hold --proof own --layouts own      as in the thesis
  lira demo --expert mylab.experts:wall      a third expert, of your own
  lira demo --world corridor --randomise     for a robot elsewhere: see `lira twin --wire`, `lira robot`, `lira drive`
  lira demo --wire        the drivers of the real robot in between, byte by byte; in real time

exit status: 0 if the novice was proven within its laps and then passed every unseen layout, without a collision and
without losing the line; 1 if not; 2 if something went wrong
"""

import argparse
import shlex
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.hal.messages import Phase
from lira.tools.options import add_expert, add_layout, add_protocol, add_randomise, add_record, add_seed, natural
from lira.tools.output.say import say

if TYPE_CHECKING:
    from lira.tools.launch.launch import Part
    from lira.tools.launch.processes import ChildProcess

POLL_S = 0.1
STALL_S = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--world", help="world by name or .toml file (default: line-obstacles; with --wire lane, which is shorter)")
    add("--profile", help="robot by name or .toml file (default: that of the world's experiment)")
    add("--method", default="plus", help="way of teaching, as in `lira fusion` (default: %(default)s)")
    add_expert(parser)
    add_seed(parser, "seeds teacher, training and noise")
    add_layout(parser, "layout to learn on")
    add("--laps", type=natural, default=12, help="give up after so many training laps (default: %(default)s)")
    add("--unseen", type=natural, default=3, help="unseen layouts to drive afterwards (default: %(default)s)")
    add_protocol(parser, layouts="fresh", usual_proof="fresh:3; in corridor and table-top fresh:6")
    add("--shield", action="store_true", help="drive the unseen layouts behind a shield, as in `lira fusion`")
    add(
        "--wire",
        action="store_true",
        help="through the robot's drivers: `lira robot` on emulated devices, in real time",
    )
    add(
        "--renderer",
        choices=("sketch", "tiny", "egl"),
        help="what draws and measures the world, as in `lira twin` (default: sketch, if there is no mesh in it)",
    )
    add_randomise(parser)
    add_record(parser)
    add("--run", type=Path, metavar="DIR", help="folder of the run (default: runs/demo-<date-time>)")


def run(args: argparse.Namespace) -> int:
    """Run the demo from start to report."""
    from lira.fusion.experts.files import expert_path, experts_of
    from lira.fusion.experts.tasks import TASKS, task_of
    from lira.fusion.methods.presets import method_named
    from lira.hal.profile import load_profile
    from lira.sim_backend.catalogue import load_world
    from lira.tools.cli import require
    from lira.tools.launch.launch import direct, twin_words, wired
    from lira.tools.launch.processes import free_port, lira_command
    from lira.tools.output.places import own_folder

    # What cannot work is refused before anything starts.
    world = args.world or ("lane" if args.wire else "line-obstacles")
    place = load_world(world)
    task = task_of(place.name)
    robot = args.profile or TASKS[task].profile
    profile = load_profile(robot)
    for expert in experts_of(profile):
        expert_path(expert, profile, task)
    proof = args.proof or f"fresh:{TASKS[task].proofs}"
    preset = method_named(args.method).taught(layouts=args.layouts, proof=proof)
    require("safetensors", *preset.packages, *(["serial"] if args.wire else []))
    from lira.fusion.experts.load import load_policy  # not sooner: it takes the learner's libraries

    for expert in args.expert:
        load_policy(expert, profile)
    folder: Path = args.run or own_folder(Path("runs"), "demo-")
    port = free_port()
    name, endpoint = f"demo_{port}", f"127.0.0.1:{port}"
    both = ["--layout", str(args.layout), "--seed", str(args.seed)]
    twin = twin_words(world, robot, args.seed, args.renderer, randomise=args.randomise)
    twin += ["--layout", str(args.layout)]
    fusion = [*both, "--name", name, "--connect", endpoint, "--method", args.method, "--teacher", "scripted"]
    fusion += ["--run", str(folder), "--train-laps", str(args.laps), "--unseen", str(args.unseen)]
    fusion += ["--layouts", args.layouts, "--proof", proof]
    fusion += ["--shield"] if args.shield else []
    fusion += ["--no-record"] if args.no_record else []
    fusion += [word for expert in args.expert for word in ("--expert", expert)]
    fusion += ["--as-command", shlex.join(["lira", *sys.argv[1:]])]
    if args.wire:
        arena = f"127.0.0.1:{free_port()}"
        fusion += ["--arena", arena]
        parts = wired(name, endpoint, arena, folder / "wire", twin)
    else:
        parts = direct(name, endpoint, twin, lockstep=True)
    return supervise(parts, lira_command("fusion", *fusion), folder)


def supervise(parts: Sequence["Part"], fusion_command: list[str], folder: Path) -> int:
    """Run the robot's parts and the learner, show how they get on, stop them, write the report. Returns the status.

    Raises `ProcessError` when one of them dies.
    """
    from lira.tools.output.places import check_folder
    from lira.tools.runs.names import RECORD

    check_folder(folder)
    if (folder / RECORD).exists():
        raise ConfigError(f"{folder} already holds a run", "Choose another folder with --run.")
    try:
        watch(parts, fusion_command, folder)
    except KeyboardInterrupt:
        if (folder / RECORD).exists():
            print(f"stopped; what was learned so far: lira report {folder}")
        raise
    return conclude(folder)


def watch(parts: Sequence["Part"], fusion_command: list[str], folder: Path) -> None:
    """Start the robot, then the learner; return when the learner has ended by itself. Stops the learner first."""
    from lira.tools.launch.launch import running
    from lira.tools.launch.processes import ChildProcess

    with (
        running(parts, folder, say) as robot,
        ChildProcess("the learner", fusion_command, folder / "lira.fusion.log") as learner,
    ):
        follow(robot, learner, folder)


def follow(robot: Sequence["ChildProcess"], learner: "ChildProcess", folder: Path) -> None:
    """Show how the run gets on until the learner ends. Raises `ProcessError` if anything dies, or nothing happens."""
    from lira.tools.launch.processes import ProcessError
    from lira.tools.runs.names import RECORD
    from lira.tools.runs.progress import Display, Progress, Tail

    display, progress, tail = Display(sys.stdout), Progress(), Tail(folder / RECORD)
    ended, newest_s = False, time.monotonic()
    try:
        while not ended:
            ended = learner.wait(POLL_S) is not None  # asked before reading: what it wrote is all there
            for record in tail.read():
                newest_s = time.monotonic()
                line = progress.note(record)
                if line is not None:
                    display.keep(line)
            display.status(progress.status())
            if not ended:
                raise_dead(robot)
            if time.monotonic() - newest_s > STALL_S:
                raise ProcessError(
                    f"nothing has happened for {STALL_S:.0f} s; the learner wrote:\n{learner.tail()}",
                    f"All that was written: {', '.join(str(part.log) for part in [learner, *robot])}",
                )
    finally:
        display.close()
    if progress.result is None:
        raise_dead(robot)
        raise learner.failure()


def raise_dead(parts: Sequence["ChildProcess"]) -> None:
    """Raise `ProcessError` for the first part that does not run any more."""
    for part in parts:
        if part.status() is not None:
            raise part.failure()


def conclude(folder: Path) -> int:
    """Print the table, write the report, and return 0 if the novice was proven and passed every unseen layout."""
    from lira.tools.output.label_words import learned_words
    from lira.tools.output.proven import contradiction_words, proof_words, unseen_words
    from lira.tools.output.table import format_table
    from lira.tools.report import write_report
    from lira.tools.report.digest import load_run
    from lira.tools.report.laps import COLUMNS, lap_cells
    from lira.tools.runs.names import RECORD

    run = load_run(folder / RECORD)
    print(f"\n{format_table(COLUMNS, [lap_cells(lap) for lap in run.laps])}\n")
    unseen = [lap.record for lap in run.phase(Phase.UNSEEN) if lap.record is not None]
    proven = run.result is not None and run.result.converged
    said = [unseen_words(unseen)]
    if run.result is not None:
        said += [learned_words(run.result), proof_words(run.result), contradiction_words(run.result.contradictions)]
    for words in filter(None, said):
        print(words)
    print(f"report: {write_report(folder)}")
    return 0 if proven and all(lap.passed for lap in unseen) else 1
