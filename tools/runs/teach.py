"""Teach a method on a twin with a scripted teacher, and keep what comes of it."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

from lira.fusion.experts.tasks import task_of
from lira.fusion.log.label_log import Demonstration, DemonstrationLog
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, Record, ResultRecord, RunRecord, RunWriter
from lira.fusion.methods.base import Expert, Method, Policy
from lira.fusion.methods.context import Context
from lira.fusion.methods.presets import Preset
from lira.fusion.teaching.teacher import TEACHERS
from lira.hal.messages import Phase
from lira.hal.port import Arena, Robot
from lira.hal.profile import RobotProfile
from lira.sim_backend.world import World
from lira.tools.cli import version
from lira.tools.launch.lifetime import saving
from lira.tools.runs.build import NewTrainer, build_method, teacher
from lira.tools.runs.course import Course, run_course
from lira.tools.runs.folder import LABELS, RECORD, check_fresh, snapshot
from lira.tools.runs.progress import Publish, Say, telling


def _nowhere(_: object) -> None:
    """Keep nothing."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What is to be taught, and how. `pair` says whose experts (those of the world's task), `more` adds own ones.

    `build` builds the method where the preset's name does not say how. `folder` keeps labels, record and novice;
    `command` repeats the run. `shield` is for the unseen layouts, and for what drives afterwards.
    """

    preset: Preset
    layout: int = 0
    seed: int = 0
    laps: int = 12
    unseen: int = 3
    teacher: str = "scripted"
    pair: str | None = None
    more: Sequence[str | Expert | Policy] = ()
    build: Callable[[Context], Method] | None = None
    folder: Path | None = None
    command: str = ""
    shield: bool = False

    def head(self, profile: RobotProfile, world: str) -> RunRecord:
        """Return the head of the run's record."""
        preset = self.preset
        idle = preset.learning.idle_frames
        return RunRecord(
            world, profile.name, preset.kind, preset.name, self.layout, self.seed, self.command, version(), idle
        )


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
    publish: Publish = _nowhere,
) -> Taught:
    """Teach until the novice is proven, then let it drive unseen layouts.

    Raises `ConfigError` for a folder that already holds a run, `PluginError` for what somebody brought along.
    """
    profile, folder, laps = robot.profile, plan.folder, list[LapRecord]()
    if folder is not None:
        check_fresh(folder)
    with ExitStack() as held:
        pair = plan.pair or task_of(world.name)
        method = held.enter_context(
            closing(build_method(plan.preset, profile, plan.seed, trainer, pair, plan.more, plan.build))
        )
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
        journal = Journal(keep=keep, write=note, publish=publish)
        result = run_course(robot, arena, method, hand, journal, course, kept)
        note(result)
        return Taught(method.alone(Phase.UNSEEN), result, laps)
