"""Teaching to a quality: after each lap the novice alone drives fresh layouts, until it passes the share wanted.

What it had taken until a level of quality was reached is its effort. Who reaches one is tried at once on other layouts,
which decide nothing, in all ways in which it could be deployed: as it is, behind the protective field, behind the
shield, with somebody to ask.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Literal

import msgspec

from lira.fusion.control import Teacher
from lira.fusion.learning.kernel_novice import KernelNovice
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, Pose, Record, ResultRecord, StepRecord
from lira.fusion.methods.base import Method
from lira.fusion.methods.shield import Shield, Shielded
from lira.fusion.methods.stop_and_ask import Doubtful
from lira.fusion.teaching.ride import Drive
from lira.fusion.teaching.session import Session
from lira.hal.messages import Phase
from lira.hal.profile import Field, RobotProfile, load_profile
from lira.sim_backend.foresight import with_small_camera
from lira.sim_backend.shifts import shifted
from lira.sim_backend.world import World
from lira.tools.experiments.fleet import Fleet, fleet
from lira.tools.runs.course import Course, lap
from lira.tools.runs.simulated import SimulatedRobot, simulate

Way = Literal["plain", "field", "shield", "ask"]
WAYS: tuple[Way, ...] = ("plain", "field", "shield", "ask")
# For robots whose profile has none: at 1 m/s a robot of 5 Hz goes 0.2 m before it knows.
FIELD = Field(stop_m=0.10, slow_m=0.45, slow_m_s=0.2, margin_m=0.02, max_age_s=0.5)
FAR_M = 1.0  # no robot drives so far in a step: it was put down anew


class Quality(msgspec.Struct, frozen=True):
    """What is asked of a novice: to pass these shares of `layouts` fresh ones after one lap, lowest first.

    Where it is taught and proven may be `randomised`; where it is tried afterwards is not. `ways` are those in which
    who reaches the lowest level is tried, under `shift`; the first one goes for all levels. After the highest level
    `more` laps follow. A novice that can reach no level any more after half of the layouts is not driven on the others.
    """

    layouts: int = 12
    levels: tuple[float, ...] = (0.9, 0.97)
    ways: tuple[Way, ...] = ("plain",)
    shift: str | None = None
    more: int = 0
    randomised: bool = False


def least(level: float, layouts: int) -> int:
    """How many of so many layouts a level asks for."""
    return math.ceil(level * layouts - 1e-9)


class Point(msgspec.Struct, frozen=True):
    """A point of the curve: what `lap` laps of teaching had taken, and how the novice then drove fresh layouts."""

    lap: int
    human_labels: int
    demonstration: int
    interventions: int
    calls: int
    human_s: float
    layouts: int = 0
    passed: int = 0
    collisions: int = 0
    driven_m: float = 0.0

    def reaches(self, level: float, layouts: int = 12) -> bool:
        """Whether so large a share of so many layouts was passed."""
        return self.passed >= least(level, layouts)


class Judged(msgspec.Struct, frozen=True):
    """How a novice drove layouts that decide nothing, when it had just reached `levels`; none: after the last laps."""

    levels: tuple[float, ...]
    way: Way
    layouts: int
    passed: int
    collisions: int
    lost: int
    stops: int
    driven_m: float


class Tape:
    """Measures how far was driven."""

    def __init__(self) -> None:
        self.driven_m = 0.0
        self._last: Pose | None = None

    def write(self, record: Record) -> None:
        """Take a step or the end of a lap."""
        if isinstance(record, StepRecord) and record.state is not None:
            here, last, self._last = record.state, self._last, record.state
            step_m = math.hypot(here.x_m - last.x_m, here.y_m - last.y_m) if last is not None else 0.0
            self.driven_m += step_m if step_m < FAR_M else 0.0
        elif isinstance(record, LapRecord):
            self._last = None


def shown(
    robots: Fleet,
    driver: Method,
    drives: Sequence[Drive],
    phase: Phase,
    lap: int,
    journal: Journal,
    apprentice: Method | None = None,
) -> tuple[list[LapRecord], float]:
    """Let a novice drive some layouts abreast; returns what came of each, and how far they drove in all."""
    tapes = [Tape() for _ in drives]
    records = robots.drive(driver, drives, phase, lap, [journal.aside(tape.write) for tape in tapes], apprentice)
    for record in records:
        journal.write(record)
    return records, math.fsum(tape.driven_m for tape in tapes)


Judge = Callable[[tuple[float, ...]], Sequence[Judged]]
Hand = Callable[[RobotProfile, World], AbstractContextManager[Teacher]]
"""Opens somebody who answers."""


def teach_to(
    quality: Quality,
    robot: SimulatedRobot,
    method: Method,
    hand: Teacher,
    journal: Journal,
    course: Course,
    judge: Judge,
    robots: Fleet,
) -> tuple[ResultRecord, list[Point], list[Judged]]:
    """Teach for at most the course's laps; `judge` tries who reached a level, `robots` show how good the novice is."""
    session = Session(robot, robot.arena, journal, method, method.alone)
    points: list[Point] = []
    judged: list[Judged] = []
    waiting, more = list(quality.levels), quality.more
    for number in range(1, course.laps + quality.more + 1):
        session.train(course, hand, number)
        points.append(_point(quality, method, journal, course, number, robots))
        new = tuple(level for level in waiting if points[-1].reaches(level, quality.layouts))
        if new:
            waiting = [level for level in waiting if level not in new]
            judged += judge(new)
        if number >= course.laps and waiting:
            break
        if not waiting:
            if more == 0:
                break
            more -= 1
    if quality.more:
        judged += judge(())
    return session.result(not waiting, course.syllabus.proof), points, judged


def _point(quality: Quality, method: Method, journal: Journal, course: Course, number: int, robots: Fleet) -> Point:
    ledger = journal.ledger
    laps, driven_m = list[LapRecord](), 0.0
    if method.novice.trained:
        drives = [drive for run in course.proven(number) for drive in run]
        driver, half = method.alone(Phase.PROVE), len(drives) // 2
        laps, driven_m = shown(robots, driver, drives[:half], Phase.PROVE, number, journal, method)
        if sum(each.passed for each in laps) + len(drives) - half >= least(quality.levels[0], len(drives)):
            more, more_m = shown(robots, driver, drives[half:], Phase.PROVE, number, journal, method)
            laps, driven_m = laps + more, driven_m + more_m
    return Point(
        lap=number,
        human_labels=ledger.labels.stored_human,
        demonstration=ledger.labels.demonstration,
        interventions=ledger.interventions,
        calls=ledger.calls,
        human_s=ledger.account.human_steps * course.profile.period_s,
        layouts=len(laps),
        passed=sum(each.passed for each in laps),
        collisions=sum(each.collisions for each in laps),
        driven_m=round(driven_m, 1),
    )


def judging(
    quality: Quality,
    method: Method,
    profile: RobotProfile,
    world: World,
    layouts: Sequence[int],
    hand: Hand,
) -> Judge:
    """Return what tries a novice on these layouts, in each way, in the world as it is shifted."""
    plain = msgspec.structs.replace(world, randomised=False)
    place, body = shifted(quality.shift, plain, with_small_camera(profile))

    def judge(levels: tuple[float, ...]) -> list[Judged]:
        asked = quality.ways if quality.levels[0] in levels else quality.ways[:1]
        ways = [way for way in asked if way != "ask" or isinstance(method.novice, KernelNovice)]
        return [_try(levels, way, method, body, place, layouts, hand) for way in ways]

    return judge


def _try(
    levels: tuple[float, ...],
    way: Way,
    method: Method,
    profile: RobotProfile,
    world: World,
    layouts: Sequence[int],
    hand: Hand,
) -> Judged:
    """The laps of one way, on a robot of their own."""
    if way == "field":
        profile = msgspec.structs.replace(profile, field=load_profile(profile.name).field or FIELD)
    driver, drives = _driver(method, way, profile), [lap(profile, world, layout) for layout in layouts]
    if way == "ask" or method.calls_alone:
        laps, driven_m = _answered(driver, profile, world, drives, hand)
    else:
        with fleet(world, profile, len(drives)) as robots:
            laps, driven_m = shown(robots, driver, drives, Phase.UNSEEN, 1, Journal())
    return Judged(
        levels,
        way,
        layouts=len(laps),
        passed=sum(each.passed for each in laps),
        collisions=sum(each.collisions for each in laps),
        lost=sum(each.lost for each in laps),
        stops=sum(each.stops for each in laps),
        driven_m=round(driven_m, 1),
    )


def _answered(
    driver: Method, profile: RobotProfile, world: World, drives: Sequence[Drive], hand: Hand
) -> tuple[list[LapRecord], float]:
    """With somebody who answers it is one robot that drives, lap after lap."""
    tape = Tape()
    with (
        simulate(world, profile, layout=drives[0].episode.layout, renderer="sketch") as robot,
        hand(profile, world) as answering,
    ):
        session = Session(robot, robot.arena, Journal(write=tape.write), None, lambda _: driver)
        return session.show(drives, answering), tape.driven_m


def _driver(method: Method, way: Way, profile: RobotProfile) -> Method:
    if way == "ask":
        novice = method.novice
        return Doubtful(novice.alone, novice.doubts) if isinstance(novice, KernelNovice) else method.alone(Phase.UNSEEN)
    alone = method.alone(Phase.UNSEEN)
    return Shielded(alone, Shield(profile)) if way == "shield" else alone
