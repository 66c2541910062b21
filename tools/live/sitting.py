"""One sitting of `lira teach` on a robot that is on the bus: from the first request to the report's last record."""

import argparse
import contextlib
from dataclasses import dataclass

import msgspec

from lira.fusion.control import ControlLoop
from lira.fusion.learning.trainer import ProcessTrainer
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import RunWriter, VerdictRecord
from lira.fusion.operator_service import OperatorService
from lira.hal.bus.topics import SESSION
from lira.hal.client.remote import RemoteRobot
from lira.hal.words import plural
from lira.tools.launch.lifetime import saving, stop_or_interrupt
from lira.tools.live.board import Board
from lira.tools.live.classroom import Classroom
from lira.tools.live.lap_driver import LapDriver
from lira.tools.live.rules import Rules
from lira.tools.live.session import LiveSession
from lira.tools.operator.listen import explaining
from lira.tools.recording.beside import recorder_beside
from lira.tools.runs.course import Course
from lira.tools.runs.folder import in_the_log
from lira.tools.runs.names import LABELS, RECORD
from lira.tools.runs.plan import Plan
from lira.tools.runs.progress import Say
from lira.tools.runs.remote.reach import hand_of, reports_of, request_line, world_in, world_of


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a sitting came to. `passed` is None if nothing was proven."""

    passed: bool | None
    words: str


def sit(args: argparse.Namespace, plan: Plan, robot: RemoteRobot, rules: Rules, say: Say) -> Outcome:
    """Teach until the person ends the session, or Ctrl-C does; what was learned is saved however it ends."""
    arena, world = robot.arena, world_in(bytes(robot.info.arena))
    course = None if world is None else Course(robot.profile, world, plan.layout)
    folder = plan.folder
    assert folder is not None
    publish = reports_of(robot)
    with contextlib.ExitStack() as stack:
        wait_for_recorder = stack.enter_context(recorder_beside(args, folder, say))
        wait_for_recorder()
        room = stack.enter_context(Classroom(plan, robot.profile, world_of(robot), ProcessTrainer, say, publish))
        record = stack.enter_context(RunWriter(folder / RECORD))
        record.write(room.head)
        sessions = robot.bus.publisher(SESSION)
        journal = Journal(keep=room.keep, write=record.write, publish=publish)
        room.before.go_on(journal.ledger)
        hand = stack.enter_context(hand_of(args))
        loop = ControlLoop(robot, truth=None if arena is None else robot.state)
        board = Board(
            rules.person, room.before, journal.ledger, robot.now, lambda state: sessions.put(state, robot.now()), say
        )
        driver = LapDriver(robot, arena, loop, room, journal, hand, rules, board, say, explaining(robot.bus))
        session = LiveSession(driver, course, room, journal, rules, say)
        stack.enter_context(saving(room.snapshot, say))
        driver.stop = stack.enter_context(stop_or_interrupt())
        line = stack.enter_context(request_line(robot, args))
        driver.service = stack.enter_context(
            contextlib.closing(
                OperatorService(line, loop, room.method, journal, say, snapshot=room.snapshot, session=session.take)
            )
        )
        loop.arm()
        if room.before.newest is not None:
            say(f"goes on with {plural(room.method.novice.stored, 'label')} learned before")
        session.run()
        aside = in_the_log(folder / LABELS, room.method.novice.set_aside())
        record.write(msgspec.structs.replace(session.result(), contradictions=tuple(aside)))
        passed = session.converged if session.words else None
        record.write(VerdictRecord(rules.person, session.words or "Nothing was proven", bool(passed)))
    return Outcome(passed, session.words)
