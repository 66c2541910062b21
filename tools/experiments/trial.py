"""One trial: one method taught on one layout by one teacher, from scratch to convergence or its cap."""

import hashlib
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import msgspec

from lira.fusion.experts.tasks import TASKS, task_of
from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, Record, ResultRecord
from lira.fusion.methods.base import Method
from lira.fusion.methods.presets import Preset as Preset
from lira.fusion.methods.presets import file_name
from lira.fusion.teaching.teacher import SKILLED, ScriptedTeacher, TeacherSettings
from lira.hal.messages import Action, Phase
from lira.hal.profile import RobotProfile, load_profile
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.foresight import with_small_camera
from lira.sim_backend.scenes.opening import quickest
from lira.sim_backend.world import World
from lira.tools.experiments.fleet import fleet
from lira.tools.experiments.notes import Notes, Track
from lira.tools.experiments.quality import Judged, Point, Quality, judging, teach_to
from lira.tools.runs.build import build_method, teacher
from lira.tools.runs.course import Course, run_course
from lira.tools.runs.simulated import SimulatedRobot, simulate

UNSEEN = 1000  # layouts from here on belong to nobody's training


class Trial(msgspec.Struct, frozen=True):
    """What is run. Trials with one seed share layout and teacher stream, whatever the method."""

    method: Preset
    world: str
    seed: int
    teacher: str = "scripted"
    skill: TeacherSettings = SKILLED  # the teacher's, of which `teacher` is the name
    laps: int = 12
    all_laps: bool = False  # go on after the novice has passed
    unseen: int = 3
    max_linear_m_s: float | None = None  # None: as fast as the robot goes
    experts: str | None = None  # a pair, as in `fusion.expert_files`; None: those of the world's task
    quality: Quality | None = None  # teach up to it, instead of to the method's own proof

    @property
    def pair(self) -> str:
        """Whose experts take part."""
        return self.experts or task_of(self.world)

    @property
    def as_played(self) -> "Trial":
        """The trial that is played for this one and all that come out the same: who knows no experts, with any pair."""
        return self if self.method.knows_experts else msgspec.structs.replace(self, experts=None)

    @property
    def profile(self) -> RobotProfile:
        """The robot of the world's task, at this trial's full speed; without protective field, as the thesis's was."""
        profile = msgspec.structs.replace(load_profile(TASKS[task_of(self.world)].profile), field=None)
        if self.max_linear_m_s is None:
            return profile
        base = msgspec.structs.replace(profile.base, max_linear_m_s=self.max_linear_m_s)
        return msgspec.structs.replace(profile, base=base)

    @property
    def file(self) -> str:
        """Name of the file that keeps its outcome: readable, and different for whatever is set differently."""
        digest = hashlib.sha256(msgspec.json.encode(self)).hexdigest()[:8]
        return f"{Path(self.world).stem}-{file_name(self.method.name)}-{self.teacher}-{self.seed}-{digest}.json"


class Outcome(msgspec.Struct, frozen=True):
    """What came of a trial. `laps` are all laps in order; a run that did not converge is censored, not dropped.

    `labels` holds the stored labels' actions by source, as in `Account`. `tracks` are those of the first training lap
    and of everything from the last one on. `fingerprint` says with which code and experts it was played.
    """

    trial: Trial
    laps: tuple[LapRecord, ...]
    result: ResultRecord
    labels: dict[str, tuple[Action, ...]]
    tracks: tuple[Track, ...]
    fingerprint: str = ""
    points: tuple[Point, ...] = ()
    judged: tuple[Judged, ...] = ()

    def after(self, lap_number: int) -> LapRecord:
        """Totals after a training lap (the last one if there were fewer; the proving run if there was none)."""
        return ([each for each in self.laps if each.phase == Phase.TRAIN] or list(self.laps))[:lap_number][-1]


def play(trial: Trial) -> Outcome:
    """Run a trial in process, on one thread: its outcome does not depend on what runs beside it."""
    one_thread()
    profile, world = trial.profile, load_world(trial.world)
    if trial.quality is not None and trial.quality.randomised:
        world = msgspec.structs.replace(world, randomised=True)
    first = UNSEEN + trial.seed * trial.unseen
    layouts = range(first, first + trial.unseen)
    course = Course(
        profile,
        world,
        trial.seed,
        trial.method.syllabus,
        trial.laps,
        trial.all_laps,
        layouts if not trial.quality else (),
    )
    with (
        simulate(
            world, with_small_camera(profile), layout=trial.seed, seed=trial.seed, renderer=quickest(world)
        ) as robot,
        closing(build_method(trial.method, profile, trial.seed, InlineTrainer, trial.pair)) as method,
        closing(teacher(trial.skill, profile, world, trial.seed, trial.seed)) as hand,
    ):
        if trial.quality is not None:
            return _to_quality(trial, trial.quality, robot, method, hand, course, layouts)
        notes = Notes()
        result = run_course(robot, robot.arena, method, hand, Journal(keep=notes.label, write=notes.record), course)
    return Outcome(trial, tuple(notes.laps), result, notes.labels, notes.tracks)


def _to_quality(
    trial: Trial,
    quality: Quality,
    robot: SimulatedRobot,
    method: Method,
    hand: ScriptedTeacher,
    course: Course,
    layouts: Sequence[int],
) -> Outcome:
    """Teach until the novice is as good as is wanted; of the laps only the numbers are kept."""
    laps: list[LapRecord] = []

    def write(record: Record) -> None:
        if isinstance(record, LapRecord):
            laps.append(record)

    def answering(profile: RobotProfile, world: World) -> closing[ScriptedTeacher]:
        return closing(teacher(trial.skill, profile, world, layouts[0], trial.seed))

    judge = judging(quality, method, course.profile, course.world, layouts, answering)
    with fleet(course.world, with_small_camera(course.profile), quality.layouts) as robots:
        result, points, judged = teach_to(quality, robot, method, hand, Journal(write=write), course, judge, robots)
    return Outcome(trial, tuple(laps), result, {}, (), points=tuple(points), judged=tuple(judged))
