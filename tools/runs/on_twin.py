"""What takes a twin over the bus: a scripted teacher who sees everything, and a policy on layouts it has not seen."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import msgspec

from lira.fusion.experts.load import load_alone
from lira.fusion.experts.tasks import task_of
from lira.fusion.learning.trainer import ProcessTrainer
from lira.fusion.log.recorder import Journal
from lira.hal.bus.bus import Bus
from lira.hal.client.arena import WiredArena
from lira.hal.client.remote import RemoteArena, RemoteRobot
from lira.hal.errors import ConfigError
from lira.hal.port import Arena
from lira.sim_backend.world import World
from lira.tools.launch.lifetime import CLOSE_S
from lira.tools.runs.course import Course, show_alone
from lira.tools.runs.teach import Plan, Publish, Say, teach_on, telling

NO_TWIN = "Here, a person teaches (--teacher none), and a policy drives without --unseen."


def teach(args: argparse.Namespace, plan: Plan, robot: RemoteRobot, publish: Publish, say: Say) -> int:
    """Teach until the novice passes its proving run, then let it drive unseen layouts. Returns 1 if it did not pass."""
    in_step = partial(ProcessTrainer, adopt_after_s=robot.profile.period_s)  # one period later, whatever it took
    with arena_of(args, robot) as (arena, world):
        return 0 if teach_on(robot, arena, world, plan, in_step, say, publish).converged else 1


def examine(args: argparse.Namespace, robot: RemoteRobot, publish: Publish, say: Say) -> int:
    """Let a policy drive the layouts after `args.layout`; it goes on behind a crash. Returns 1 if any failed."""
    with arena_of(args, robot) as (arena, world):
        policy = load_alone(
            args.policy, robot.profile, args.experts or task_of(world.name), ask=args.ask, shield=args.shield
        )
        journal = Journal(write=telling(say), publish=publish)
        unseen = range(args.layout + 1, args.layout + 1 + args.unseen)
        course = Course(robot.profile, world, unseen=unseen)
        return 0 if show_alone(robot, arena, policy, journal, course) else 1


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
