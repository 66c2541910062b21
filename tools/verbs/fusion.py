"""The learner: reads the robot's sensors, decides five times a second, drives, and learns from whoever helps.

It drives whatever robot has that name on the bus: the twin, or the real one. With --policy it only drives. With
--method it learns: from a person with a gamepad, or, on a twin, from a scripted teacher until the novice drives a lap
alone. What it learns goes into the --run folder: labels.lira (every label), novice.safetensors, run.jsonl.

examples:
  lira fusion --policy camera-expert                   let one expert drive
  lira fusion --policy runs/demo-1/novice.safetensors  let a trained novice drive
  lira fusion --method lira --run runs/mine            learn from a person
  lira fusion --method lira --teacher scripted --run runs/taught
  lira fusion --method lira --experts corridor         in a real corridor
"""

import argparse
import signal
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fusion.tasks import task_of
from hal.errors import ConfigError
from tools.arguments import natural

if TYPE_CHECKING:
    from fusion.presets import Method
    from hal.messages import Decision
    from hal.port import Arena
    from hal.remote import RemoteRobot

ENDPOINT = "127.0.0.1:7447"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--name", default="rosbot", help="the robot's name on the bus (default: %(default)s)")
    add("--connect", default=ENDPOINT, metavar="HOST:PORT", help="where the robot listens (default: %(default)s)")
    add(
        "--arena",
        metavar="HOST:PORT",
        help="scripted teacher of a robot on a twin's devices: where that twin tells the truth (its --arena)",
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--policy", help="drive only: camera-expert, lidar-expert or a .safetensors file")
    add(
        "--experts",
        metavar="PAIR",
        help="whose experts: a task (line, passage, garden, corridor), TASK@SEED, or a folder with camera.safetensors "
        "and lidar.safetensors (default: those of a twin's world; line)",
    )
    what.add_argument(
        "--method",
        help="learn by this method: hold or lira (LIRA-SPF), thesis, hg-dagger, ...; an unknown name lists them all",
    )
    add("--start", choices=("human", "experts"), help="LIRA-SPF: who drives before the first training step")
    add(
        "--idle-frames",
        choices=("label", "skip"),
        default="label",
        help="steps with the dead-man held and the stick at rest: labels as all others, or none (default: %(default)s)",
    )
    add(
        "--teacher",
        choices=("none", "scripted", "perfect", "unskilled"),
        default="none",
        help="who helps: a person with a gamepad (none), or on a twin a script with few, no or many human faults",
    )
    add(
        "--train-laps",
        type=natural,
        default=12,
        help="scripted teacher: give up after so many laps (default: %(default)s)",
    )
    add("--unseen", type=natural, default=0, help="then drive so many unseen layouts alone (default: %(default)s)")
    add("--layout", type=natural, default=0, help="layout to learn on, and to reset a twin to (default: %(default)s)")
    add("--seed", type=natural, default=0, help="seeds teacher and training (default: %(default)s)")
    add("--run", type=Path, metavar="DIR", help="folder for what is learned (default: runs/<method>)")
    add("--as-command", help=argparse.SUPPRESS)  # what a report shows as the command that repeats the run


def run(args: argparse.Namespace) -> int:
    """Drive until done or told to stop. Exit status 1 if a taught novice did not pass its proving run."""
    import torch

    from hal.bus import Bus
    from hal.remote import RemoteRobot

    if args.method is not None and method_of(args).kind == "switching" and args.teacher == "none":
        raise ConfigError(f"by the method '{args.method}' nobody learns", "Show it on a twin with --teacher perfect.")
    torch.set_num_threads(1)  # the nets are small; and a result should not depend on the number of cores
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    bus = Bus(args.name, connect=args.connect)
    robot = RemoteRobot(bus)
    try:
        robot.open()
        if args.policy is not None:
            from tools.person import show_policy

            return show_policy(args, robot, publisher(robot), say)
        return learn_by_hand(args, robot) if args.teacher == "none" else learn_from_script(args, robot)
    finally:
        robot.close()
        bus.close()


def learn_by_hand(args: argparse.Namespace, robot: "RemoteRobot") -> int:
    """Learn from whoever takes the wheel."""
    from fusion.session import Apprentice
    from fusion.trainer import ProcessTrainer
    from tools.assembly import apprentice
    from tools.person import learn_from_person, world_of

    def make() -> Apprentice:
        pair = args.experts or task_of(world_of(robot))
        return apprentice(method_of(args), robot.profile, args.seed, ProcessTrainer, pair)

    return learn_from_person(args, robot, make, publisher(robot), say)


def learn_from_script(args: argparse.Namespace, robot: "RemoteRobot") -> int:
    """Teach until the novice passes its proving run, then let it drive unseen layouts."""
    from hal.bus import Bus
    from hal.remote import RemoteArena
    from hal.remote_arena import WiredArena

    if args.arena is None:
        arena = RemoteArena(robot)
        return teach(args, robot, arena, arena.info)
    bus = Bus(args.name, connect=args.arena)
    try:
        wired = WiredArena(bus, robot)
        return teach(args, robot, wired, wired.info)
    finally:
        bus.close()


def teach(args: argparse.Namespace, robot: "RemoteRobot", arena: "Arena", arena_info: bytes) -> int:
    """Run a whole session with a scripted teacher in an arena."""
    import msgspec

    from fusion.control import ControlLoop
    from fusion.demonstrations import DemonstrationLog
    from fusion.journal import Journal
    from fusion.record import RunWriter
    from fusion.session import Session
    from fusion.teacher import TEACHERS
    from fusion.trainer import ProcessTrainer
    from sim_backend.world import World
    from tools.assembly import crew, lap, teacher
    from tools.run_folder import LABELS, RECORD, head, snapshot

    world = msgspec.json.decode(arena_info, type=World | None)
    if world is None:
        raise ConfigError("a scripted teacher needs a twin to see in", "Use --teacher none with a gamepad here.")
    folder: Path = args.run or Path("runs") / args.method
    if (folder / RECORD).exists() or (folder / LABELS).exists():
        raise ConfigError(f"{folder} already holds a run", "Choose another folder with --run.")
    profile = robot.profile
    in_step = partial(ProcessTrainer, adopt_after_s=profile.period_s)  # one period later, whatever it took
    with (
        DemonstrationLog(folder / LABELS, profile, mirrored=method_of(args).mirrored) as log,
        RunWriter(folder / RECORD) as record,
    ):
        record.write(head(args, profile, world.name))
        team = crew(method_of(args), profile, args.seed, in_step, args.experts or task_of(world.name))
        try:
            journal = Journal(keep=log.append, write=record.write, publish=publisher(robot))
            loop = ControlLoop(robot, truth=arena.state)
            session = Session(robot, arena, loop, journal, team.pupil, team.alone)
            loop.arm()
            hand = teacher(TEACHERS[args.teacher], profile, world, args.layout, args.seed)
            course = [lap(profile, world, args.layout)]
            if team.pupil is None:
                converged = session.prove(course)
            else:
                converged = session.teach(course, hand, args.train_laps)
                snapshot(folder, team.pupil.novice, profile, args)()
            unseen = [lap(profile, world, args.layout + 1 + k) for k in range(args.unseen)]
            session.show(unseen, hand if team.answered else None)
            record.write(session.result(converged))
        finally:
            team.close()
    return 0 if converged else 1


def method_of(args: argparse.Namespace) -> "Method":
    """Return the method by name, with what the other arguments say about it. Raises `ConfigError`."""
    import msgspec

    from fusion.lira import LiraSettings
    from fusion.presets import method_named

    method = method_named(args.method)
    if args.start is not None:
        if not isinstance(method.approach, LiraSettings):
            raise ConfigError(f"'{method.name}' takes no --start", "Only LIRA-SPF does.")
        method = msgspec.structs.replace(method, approach=msgspec.structs.replace(method.approach, start=args.start))
    learning = msgspec.structs.replace(method.learning, idle_frames=args.idle_frames)
    return msgspec.structs.replace(method, learning=learning)


def publisher(robot: "RemoteRobot") -> Callable[["Decision"], None]:
    """Return what puts decisions on the bus."""
    from hal.topics import DECISION

    topic = robot.bus.publisher(DECISION)
    return lambda decision: topic.put(decision, robot.now())


def say(line: str) -> None:
    """Print a line at once."""
    print(line, flush=True)
