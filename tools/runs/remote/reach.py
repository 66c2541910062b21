"""What is reached over the bus beside a robot's sensors: the truth about a twin, and what a person asks."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lira.fusion.operator_service import RequestLine
from lira.hal.bus.services import LOCKSTEP, understood
from lira.hal.bus.topics import DECISION, IN_LOCKSTEP, METHOD
from lira.hal.client.arena import WiredArena
from lira.hal.client.connect import on_bus
from lira.hal.client.remote import RemoteArena, RemoteRobot
from lira.hal.errors import ConfigError
from lira.hal.messages import Episode
from lira.hal.port import Arena
from lira.sim_backend.world import World
from lira.tools.launch.lifetime import CLOSE_S
from lira.tools.live.hand import Hand
from lira.tools.runs.progress import Publish

FLOOR = "floor"  # the world of a robot that is in none of ours
PAUSED = "paused: P on a screen, or square on the pad, begins"
NO_TWIN = "Here, a person teaches (--teacher none), and a policy drives without --unseen."


@contextmanager
def arena_of(args: argparse.Namespace, robot: RemoteRobot) -> Iterator[tuple[Arena, World]]:
    """Reach into the twin behind a robot, or behind its devices. Raises `ConfigError` for a robot that is none."""
    if args.arena is None:
        remote = RemoteArena(robot)
        yield remote, _needed(remote.info)
        return
    with on_bus(args.arena, args.name, close_s=CLOSE_S) as bus:
        wired = WiredArena(bus, robot)
        yield wired, _needed(wired.info)


def _needed(info: bytes) -> World:
    world = world_in(info)
    if world is None:
        raise ConfigError("only a twin has layouts to drive, and shows a teacher where the robot is", NO_TWIN)
    return world


@contextmanager
def request_line(robot: RemoteRobot, args: argparse.Namespace) -> Iterator[RequestLine]:
    """Listen to what a person asks."""
    with on_bus(args.connect, args.name, watch=True, close_s=CLOSE_S) as watch:
        yield RequestLine(robot.bus, watch, robot.now)


@contextmanager
def hand_of(args: argparse.Namespace) -> Iterator[Hand]:
    """Listen to whether a hand drives."""
    with on_bus(args.connect, args.name, watch=True, close_s=CLOSE_S) as watch:
        yield Hand(watch)


def restarter(robot: RemoteRobot, args: argparse.Namespace) -> Callable[[], None] | None:
    """Return what puts a twin's robot back to the start; None for a real robot."""
    arena = robot.arena
    return None if arena is None else lambda: arena.reset(Episode(args.layout))


def world_in(info: bytes) -> World | None:
    """Return a twin's world, from what its arena says; None for a real robot's. Raises `BusError`."""
    world: World | None = understood(World | None, info)
    return world


def world_of(robot: RemoteRobot) -> str:
    """Return the name of a twin's world; `FLOOR` for a real robot."""
    world = world_in(bytes(robot.info.arena))
    return FLOOR if world is None else world.name


def reports_of(robot: RemoteRobot) -> Publish:
    """Return what puts decisions, and the calls of the method that made them, on the bus.

    In lockstep nothing of it is lost: time waits.
    """
    qos = IN_LOCKSTEP if robot.info.mode == LOCKSTEP else None
    topics = {topic.kind: robot.bus.publisher(topic, qos) for topic in (DECISION, METHOD)}
    return lambda report: topics[type(report)].put(report, robot.now())
