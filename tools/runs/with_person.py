"""Learning from a person, and showing them a policy: they may take control at any time, and ask for things."""

import argparse
import contextlib
from collections.abc import Callable, Iterator

import msgspec

from lira.fusion.control import ControlLoop
from lira.fusion.experts.load import load_alone
from lira.fusion.experts.tasks import task_of
from lira.fusion.learning.labels import Label
from lira.fusion.log.label_log import DemonstrationLog, read_demonstrations
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import RunWriter
from lira.fusion.operator_service import OperatorService, RequestLine
from lira.fusion.service import serve
from lira.hal.bus.bus import Bus
from lira.hal.client.remote import RemoteArena, RemoteRobot
from lira.hal.messages import Episode
from lira.sim_backend.world import World
from lira.tools.launch.lifetime import CLOSE_S, saving, stop_or_interrupt
from lira.tools.runs.build import NewTrainer, build_method
from lira.tools.runs.folder import FLOOR, LABELS, RECORD, snapshot
from lira.tools.runs.teach import Plan, Publish, Say


def show_policy(args: argparse.Namespace, robot: RemoteRobot, publish: Publish, say: Say) -> int:
    """Let one policy drive until Ctrl-C."""
    method = load_alone(
        args.policy, robot.profile, args.experts or task_of(world_of(robot)), ask=args.ask, shield=args.shield
    )
    journal, loop = Journal(publish=publish), ControlLoop(robot)
    with stop_or_interrupt() as stop, request_line(robot, args) as line:
        service = OperatorService(line, loop, method, journal, say, restart=restarter(robot, args))
        loop.arm()
        say(f"'{args.policy}' drives '{args.name}'; stop with Ctrl-C")
        serve(loop, method, journal, stop, say, operator_service=service)
    return 0


def learn_from_person(
    args: argparse.Namespace, plan: Plan, robot: RemoteRobot, trainer: NewTrainer, publish: Publish, say: Say
) -> int:
    """Learn from whoever takes control with the dead-man, until Ctrl-C; then, or when it fails, save the novice."""
    profile, world = robot.profile, world_of(robot)
    head, folder = plan.head(profile, world), plan.folder
    assert folder is not None
    # The log goes first: if it is damaged, nothing else is touched.
    with (
        DemonstrationLog(folder / LABELS, profile, mirrored=plan.preset.mirrored, say=say) as log,
        RunWriter(folder / RECORD) as record,
    ):
        method = build_method(plan.preset, profile, plan.seed, trainer, plan.pair or task_of(world), plan.more)
        novice = method.novice
        with saving(lambda: snapshot(folder, novice, profile, head), say), contextlib.closing(method):
            record.write(head)
            for old in read_demonstrations(log.path):
                if old.stored:
                    novice.remember(Label(old.features, old.action, old.source, novice.weight(old.source)))
            journal, loop = Journal(keep=log.append, write=record.write, publish=publish), ControlLoop(robot)
            with stop_or_interrupt() as stop, request_line(robot, args) as line:
                service = OperatorService(
                    line,
                    loop,
                    method,
                    journal,
                    say,
                    restart=restarter(robot, args),
                    snapshot=lambda: snapshot(folder, novice, profile, head, log.sync),
                )
                loop.arm()
                say(f"{args.method} learns on '{args.name}' with {novice.stored} labels; hold the dead-man to drive")
                with contextlib.closing(service):
                    serve(
                        loop,
                        method,
                        journal,
                        stop,
                        say,
                        lambda: novice.training_steps,
                        operator_service=service,
                        layout=args.layout,
                    )
    return 0


@contextlib.contextmanager
def request_line(robot: RemoteRobot, args: argparse.Namespace) -> Iterator[RequestLine]:
    """Listen to what a person asks."""
    watch = Bus(args.name, connect=args.connect, watch=True)
    try:
        yield RequestLine(robot.bus, watch, robot.now)
    finally:
        watch.close(CLOSE_S)


def restarter(robot: RemoteRobot, args: argparse.Namespace) -> Callable[[], None] | None:
    """Return what puts a twin's robot back to the start; None for a real robot."""
    arena = RemoteArena(robot)
    return None if world_of(robot) == FLOOR else lambda: arena.reset(Episode(args.layout))


def world_of(robot: RemoteRobot) -> str:
    """Return the name of a twin's world; `FLOOR` for a real robot."""
    world = msgspec.json.decode(robot.info.arena, type=World | None)
    return FLOOR if world is None else world.name
