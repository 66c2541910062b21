"""A policy that drives by itself: until it is told to stop, or through layouts of a twin that it has not seen."""

import argparse

from lira.fusion.control import ControlLoop
from lira.fusion.experts.load import load_alone
from lira.fusion.experts.tasks import task_of
from lira.fusion.log.recorder import Journal
from lira.fusion.operator_service import OperatorService
from lira.fusion.service import serve
from lira.hal.client.remote import RemoteRobot
from lira.tools.launch.lifetime import stop_or_interrupt
from lira.tools.launch.notify import Notifier
from lira.tools.operator.listen import explaining
from lira.tools.runs.course import Course, show_alone
from lira.tools.runs.progress import Publish, Say, telling
from lira.tools.runs.remote.reach import PAUSED, arena_of, request_line, restarter, world_of


def show(args: argparse.Namespace, robot: RemoteRobot, publish: Publish, say: Say) -> int:
    """Let one policy drive until Ctrl-C."""
    method = load_alone(
        args.policy, robot.profile, args.experts or task_of(world_of(robot)), ask=args.ask, shield=args.shield
    )
    journal, loop, notifier = Journal(publish=publish), ControlLoop(robot), Notifier.from_environment()
    explain = explaining(robot.bus)
    with stop_or_interrupt() as stop, request_line(robot, args) as line:
        service = OperatorService(line, loop, method, journal, say, restart=restarter(robot, args), paused=args.paused)
        service.begin()
        words = f"'{args.policy}' drives '{args.name}'; {PAUSED if args.paused else 'stop with Ctrl-C'}"
        say(words)
        notifier.ready(words)
        serve(loop, method, journal, stop, say, operator_service=service, explain=explain, alive=notifier.alive)
    return 0


def examine(args: argparse.Namespace, robot: RemoteRobot, publish: Publish, say: Say) -> int:
    """Let a policy drive the layouts after `args.layout`; it goes on behind a crash. Returns 1 if any failed."""
    with arena_of(args, robot) as (arena, world):
        policy = load_alone(
            args.policy, robot.profile, args.experts or task_of(world.name), ask=args.ask, shield=args.shield
        )
        journal = Journal(write=telling(say), publish=publish)
        unseen = range(args.layout + 1, args.layout + 1 + args.unseen)
        course = Course(robot.profile, world, unseen=unseen)
        say(f"'{args.policy}' drives layouts {unseen[0]} to {unseen[-1]} of '{world.name}' alone")
        return 0 if show_alone(robot, arena, policy, journal, course) else 1
