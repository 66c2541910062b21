"""Teach a method on a twin with a scripted teacher, and keep what comes of it."""

from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass

from lira.fusion.experts.tasks import task_of
from lira.fusion.learning.trainer import NewTrainer
from lira.fusion.log.label_log import Demonstration, DemonstrationLog
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, Record, ResultRecord, RunWriter
from lira.fusion.methods.base import Method
from lira.fusion.teaching.teacher import TEACHERS
from lira.hal.messages import Phase
from lira.hal.port import Arena, Robot
from lira.sim_backend.world import World
from lira.tools.launch.lifetime import saving
from lira.tools.runs.build import teacher
from lira.tools.runs.course import Course, run_course
from lira.tools.runs.folder import check_fresh, snapshot
from lira.tools.runs.names import LABELS, RECORD
from lira.tools.runs.plan import Plan, build_traced
from lira.tools.runs.progress import Publish, Say, telling


def _nowhere(_: object) -> None:
    """Keep nothing."""


@dataclass(slots=True)
class Taught:
    """What came of it: who drives alone from now on, the sum, and how each lap went."""

    driver: Method
    result: ResultRecord
    laps: list[LapRecord]

    @property
    def converged(self) -> bool:
        """Whether the novice was proven: it drove alone what the syllabus asks for."""
        return self.result.converged


def teach_on(
    robot: Robot,
    arena: Arena,
    world: World,
    plan: Plan,
    trainer: NewTrainer,
    say: Say = _nowhere,
    publish: Publish | None = None,
) -> Taught:
    """Teach until the novice is proven, then let it drive unseen layouts.

    `publish` gets every decision, and every call of the method.

    Raises `ConfigError` for a folder that already holds a run, `PluginError` for what somebody brought along.
    """
    profile, folder, laps = robot.profile, plan.folder, list[LapRecord]()
    if folder is not None:
        check_fresh(folder)
    with ExitStack() as held:
        pair = plan.pair or task_of(world.name)
        method = held.enter_context(closing(build_traced(plan, profile, trainer, pair, publish)))
        hand = held.enter_context(closing(teacher(TEACHERS[plan.teacher], profile, world, plan.layout, plan.seed)))
        keep: Callable[[Demonstration], None] = _nowhere
        write = telling(say)
        if folder is not None:
            mirrored = plan.preset.mirrored
            keep = held.enter_context(DemonstrationLog(folder / LABELS, profile, mirrored=mirrored, say=say)).append
            write = telling(say, held.enter_context(RunWriter(folder / RECORD)).write)

        def note(record: Record) -> None:
            write(record)
            if isinstance(record, LapRecord):
                laps.append(record)

        head = plan.head(profile, world.name)
        note(head)
        kept = None if folder is None else saving(lambda: snapshot(folder, method.novice, profile, head), say)
        unseen = range(plan.layout + 1, plan.layout + 1 + plan.unseen)
        course = Course(profile, world, plan.layout, plan.preset.syllabus, plan.laps, unseen=unseen, shield=plan.shield)
        journal = Journal(keep=keep, write=note, publish=publish or _nowhere)
        result = run_course(robot, arena, method, hand, journal, course, kept)
        note(result)
        return Taught(method.alone(Phase.UNSEEN), result, laps)
