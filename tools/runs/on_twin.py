"""What takes a twin: a scripted teacher who sees everything, and a policy that drives layouts nobody showed it."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

import msgspec

from lira.fusion.control import ControlLoop
from lira.fusion.experts.load import load_alone
from lira.fusion.experts.tasks import task_of
from lira.fusion.learning.trainer import ProcessTrainer
from lira.fusion.log.label_log import DemonstrationLog
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import Record, RunWriter
from lira.fusion.methods.presets import Method
from lira.fusion.methods.syllabus import THESIS
from lira.fusion.teaching.session import Session
from lira.fusion.teaching.teacher import TEACHERS
from lira.hal.bus.bus import Bus
from lira.hal.client.arena import WiredArena
from lira.hal.client.remote import RemoteArena, RemoteRobot
from lira.hal.errors import ConfigError
from lira.hal.messages import Decision
from lira.hal.port import Arena
from lira.sim_backend.world import World
from lira.tools.launch.lifetime import CLOSE_S, saving
from lira.tools.runs.build import Course, crew, teacher
from lira.tools.runs.folder import LABELS, RECORD, head, snapshot
from lira.tools.runs.progress import Progress

NO_TWIN = "Here, a person teaches (--teacher none), and a policy drives without --unseen."
Publish = Callable[[Decision], None]
Say = Callable[[str], None]


def teach(args: argparse.Namespace, method: Method, robot: RemoteRobot, publish: Publish, say: Say) -> int:
    """Teach until the novice passes its proving run, then let it drive unseen layouts. Returns 1 if it did not pass."""
    folder: Path = args.run or Path("runs") / args.method
    profile = robot.profile
    in_step = partial(ProcessTrainer, adopt_after_s=profile.period_s)  # one period later, whatever it took
    with arena_of(args, robot) as (arena, world):
        if (folder / RECORD).exists() or (folder / LABELS).exists():
            raise ConfigError(f"{folder} already holds a run", "Choose another folder with --run.")
        with (
            closing(crew(method, profile, args.seed, in_step, args.experts or task_of(world.name))) as team,
            closing(teacher(TEACHERS[args.teacher], profile, world, args.layout, args.seed)) as hand,
            DemonstrationLog(folder / LABELS, profile, mirrored=method.mirrored, say=say) as log,
            RunWriter(folder / RECORD) as record,
        ):
            write = telling(say, record.write)
            write(head(args, profile, world.name))
            journal = Journal(keep=log.append, write=write, publish=publish)
            loop = ControlLoop(robot, truth=arena.state)
            session = Session(robot, arena, loop, journal, team.pupil, team.alone)
            loop.arm()
            syllabus = method.syllabus
            course = Course(profile, world, args.layout, syllabus)
            if team.pupil is None:
                converged = session.prove(course)
            else:
                novice = team.pupil.novice
                with saving(lambda: snapshot(folder, novice, profile, args), say):
                    converged = session.teach(course, hand, args.train_laps)
            session.show(course.unseen(args.layout + 1, args.unseen), hand if team.answered else None)
            write(session.result(converged, syllabus.proof))
    return 0 if converged else 1


def examine(args: argparse.Namespace, robot: RemoteRobot, publish: Publish, say: Say) -> int:
    """Let a policy drive the layouts after `args.layout`; it goes on behind a crash. Returns 1 if any failed."""
    with arena_of(args, robot) as (arena, world):
        policy = load_alone(args.policy, robot.profile, args.experts or task_of(world.name), ask=args.ask)
        journal = Journal(write=telling(say), publish=publish)
        loop = ControlLoop(robot, truth=arena.state)
        session = Session(robot, arena, loop, journal, None, lambda _: policy)
        loop.arm()
        course = Course(robot.profile, world, args.layout, THESIS)
        laps = session.show(course.unseen(args.layout + 1, args.unseen))
    return 0 if all(each.passed for each in laps) else 1


@contextmanager
def arena_of(args: argparse.Namespace, robot: RemoteRobot) -> Iterator[tuple[Arena, World]]:
    """Reach into the twin behind a robot, or behind its devices. Raises `ConfigError` for a robot that is none."""
    if args.arena is None:
        remote = RemoteArena(robot)
        yield remote, _world(remote.info)
        return
    bus = Bus(args.name, connect=args.arena)
    try:
        wired = WiredArena(bus, robot)
        yield wired, _world(wired.info)
    finally:
        bus.close(CLOSE_S)


def _world(info: bytes) -> World:
    world = msgspec.json.decode(info, type=World | None)
    if world is None:
        raise ConfigError("only a twin has layouts to drive, and shows a teacher where the robot is", NO_TWIN)
    return world


def telling(say: Say, write: Callable[[Record], None] | None = None) -> Callable[[Record], None]:
    """Return what says how each lap went, and writes every record if there is where to."""
    progress = Progress()

    def take(record: Record) -> None:
        if write is not None:
            write(record)
        line = progress.note(record)
        if line is not None:
            say(line)

    return take
