"""One course of teaching on a twin, whoever asks for it: a verb over the bus, an experiment, or a script."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

from lira.fusion.control import Teacher
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import ResultRecord
from lira.fusion.methods.base import Method
from lira.fusion.methods.shield import Shield, Shielded
from lira.fusion.methods.syllabus import THESIS, Syllabus
from lira.fusion.teaching.ride import Drive
from lira.fusion.teaching.session import Session
from lira.hal.messages import Episode, Phase
from lira.hal.port import Arena, Robot
from lira.hal.profile import RobotProfile
from lira.sim_backend.layout import build as build_layout
from lira.sim_backend.world import World

PATIENCE = 4.0  # a lap may take so many times as long as at full speed


@dataclass(frozen=True, slots=True)
class Course:
    """The laps of a run in one world: what is taught, what has to be proven, and what is shown afterwards.

    `layout` is the run's own one, from which the syllabus derives those of its laps. At most so many `laps` are taught;
    with `all_laps` the teaching goes on after the novice was proven. `unseen` are the layouts shown afterwards, with
    `shield` behind a shield; what is proven is proven without.
    """

    profile: RobotProfile
    world: World
    layout: int = 0
    syllabus: Syllabus = THESIS
    laps: int = 12
    all_laps: bool = False
    unseen: Sequence[int] = ()
    shield: bool = False

    @property
    def spare(self) -> int:
        """How many proving runs after one lap may fail."""
        return self.syllabus.spare

    def taught(self, number: int, /) -> Sequence[Drive]:
        """The training lap of this number, from 1."""
        return [self.lap(self.syllabus.taught(self.layout, number))]

    def proven(self, number: int, /) -> Sequence[Sequence[Drive]]:
        """The proving runs after it."""
        return [[self.lap(layout)] for layout in self.syllabus.proven(self.layout, number)]

    def shown(self) -> Sequence[Drive]:
        """Laps of layouts that nobody was taught on."""
        return [self.lap(layout) for layout in self.unseen]

    def lap(self, layout: int) -> Drive:
        """A lap on a layout."""
        return lap(self.profile, self.world, layout)


def run_course(
    robot: Robot,
    arena: Arena,
    method: Method,
    teacher: Teacher | None,
    journal: Journal,
    course: Course,
    saving: AbstractContextManager[None] | None = None,
) -> ResultRecord:
    """Teach until the novice is proven, then let it drive what it has not seen.

    The teaching happens within `saving`, which keeps what was learned however it ends. A method by which nobody learns
    has its proving runs at once.
    """

    def alone(phase: Phase) -> Method:
        driver = method.alone(phase)
        return Shielded(driver, Shield(course.profile)) if course.shield and phase == Phase.UNSEEN else driver

    session = Session(robot, arena, journal, method if method.learns else None, alone)
    if method.learns:
        with saving or nullcontext():
            converged = session.teach(course, teacher, course.laps, all_laps=course.all_laps)
    else:
        converged = session.prove(course)
    session.show(course.shown(), teacher if method.calls_alone else None)
    return session.result(converged, course.syllabus.proof)


def show_alone(robot: Robot, arena: Arena, method: Method, journal: Journal, course: Course) -> bool:
    """Let a policy drive what is unseen; after a crash it goes on behind it. Returns whether it passed everything."""
    session = Session(robot, arena, journal, None, lambda _: method)
    return all(each.passed for each in session.show(course.shown()))


def lap(profile: RobotProfile, world: World, layout: int) -> Drive:
    """One lap of a world, with time enough for slow parts."""
    curve = build_layout(world, layout).curve
    length_m = world.limits.finish_m or curve.length_m * world.limits.laps
    return Drive(Episode(layout), limit_s=PATIENCE * length_m / profile.base.max_linear_m_s)
