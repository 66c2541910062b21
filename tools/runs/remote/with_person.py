"""Learning from a person: they may take control at any time, and ask for things."""

import argparse
import contextlib
from collections.abc import Callable
from functools import partial

from lira.fusion.control import ControlLoop
from lira.fusion.experts.tasks import task_of
from lira.fusion.learning.trainer import NewTrainer
from lira.fusion.log.label_log import DemonstrationLog
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import UNPROVEN, RunWriter
from lira.fusion.methods.base import Method
from lira.fusion.operator_service import Job, OperatorService
from lira.fusion.service import serve
from lira.hal.client.remote import RemoteRobot
from lira.hal.words import plural
from lira.tools.launch.lifetime import saving, stop_or_interrupt
from lira.tools.launch.notify import Notifier
from lira.tools.live.before import days_before
from lira.tools.operator.listen import explaining
from lira.tools.recording.beside import recorder_beside
from lira.tools.runs.folder import learn_again, snapshot
from lira.tools.runs.names import LABELS, RECORD
from lira.tools.runs.plan import Plan, build_traced
from lira.tools.runs.progress import Publish, Say
from lira.tools.runs.remote.reach import PAUSED, hand_of, request_line, restarter, world_of


def learn_from_person(
    args: argparse.Namespace, plan: Plan, robot: RemoteRobot, trainer: NewTrainer, publish: Publish, say: Say
) -> int:
    """Learn from whoever takes control with the dead-man, until Ctrl-C; then, or when it fails, save the novice."""
    profile, world = robot.profile, world_of(robot)
    head, folder = plan.head(profile, world), plan.folder
    notifier = Notifier.from_environment()  # before a process is started that would inherit it
    assert folder is not None
    before = days_before(folder / RECORD, head)
    # The log goes first: if it is damaged, nothing else is touched.
    with (
        DemonstrationLog(folder / LABELS, profile, mirrored=plan.preset.mirrored, say=say) as log,
        RunWriter(folder / RECORD) as record,
        recorder_beside(args, folder, say) as wait_for_recorder,
    ):
        wait_for_recorder()
        method = build_traced(plan, profile, trainer, plan.pair or task_of(world), publish)
        novice = method.novice
        with saving(lambda: snapshot(folder, novice, profile, head), say), contextlib.closing(method):
            record.write(head)
            learn_again(method, log.path)
            journal = Journal(keep=log.append, write=record.write, publish=publish)
            before.go_on(journal.ledger)
            job = partial(snapshot, folder, novice, profile, head, log.sync)
            _lesson(args, robot, method, journal, record, say, job, notifier)
    return 0


def _lesson(
    args: argparse.Namespace,
    robot: RemoteRobot,
    method: Method,
    journal: Journal,
    record: RunWriter,
    say: Say,
    snapshot: Callable[[], Job],
    notifier: Notifier,
) -> None:
    """Serve whoever teaches until Ctrl-C, and sum up."""
    novice = method.novice
    loop = ControlLoop(robot, truth=None if robot.arena is None else robot.state)
    began_s = robot.now()
    with stop_or_interrupt() as stop, request_line(robot, args) as line, hand_of(args) as hand:
        service = OperatorService(
            line,
            loop,
            method,
            journal,
            say,
            restart=restarter(robot, args),
            snapshot=snapshot,
            paused=args.paused,
        )
        service.begin()
        how = PAUSED if args.paused else "hold the dead-man to drive"
        words = f"{args.method} learns on '{args.name}' with {plural(novice.stored, 'label')}; {how}"
        say(words)
        notifier.ready(words)
        with contextlib.closing(service):
            serve(
                loop,
                method,
                journal,
                stop,
                say,
                lambda: novice.training_steps,
                operator_service=service,
                explain=explaining(robot.bus),
                layout=args.layout,
                is_attended=lambda: hand.holds,
                alive=notifier.alive,
            )
        # Nothing is proven here: that takes a session with an end.
        result = journal.result(
            converged=False,
            laps=service.episode,
            training_steps=novice.training_steps,
            simulated_s=robot.now() - began_s,
            proof=UNPROVEN,
        )
        record.write(result)
