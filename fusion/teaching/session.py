"""A course of teaching on a twin: laps with the teacher, a proving run after each, then layouts never seen."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

from lira.fusion.control import ControlLoop, Teacher
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, ResultRecord
from lira.fusion.methods.base import Alone, Method
from lira.fusion.teaching.ride import Drive, Place, Ride, Tally, lap_record
from lira.hal.messages import Driver, Phase
from lira.hal.port import Arena, Robot


class Course(Protocol):
    """What is driven, lap by lap, numbers counting from 1."""

    @property
    def spare(self) -> int:
        """How many proving runs after one lap may fail."""

    def taught(self, number: int, /) -> Sequence[Drive]:
        """The drives of a training lap."""

    def proven(self, number: int, /) -> Sequence[Sequence[Drive]]:
        """The proving runs after it, each some drives."""


@dataclass(frozen=True, slots=True)
class Same:
    """The same drives every lap, and to prove the novice: the thesis's course, and that of an expert."""

    drives: Sequence[Drive]
    spare: int = 0

    def taught(self, _: int, /) -> Sequence[Drive]:
        """All drives."""
        return self.drives

    def proven(self, _: int, /) -> Sequence[Sequence[Drive]]:
        """All drives, as one proving run."""
        return [self.drives]


class Session:
    """Teaches one apprentice on one robot, which it arms.

    `alone` says who drives in a phase without the teacher: the novice, if it is not given. Without
    an apprentice there is nobody to teach, only `alone` to be shown.
    """

    def __init__(
        self,
        robot: Robot,
        arena: Arena,
        journal: Journal,
        apprentice: Method | None,
        alone: Callable[[Phase], Method] | None = None,
    ) -> None:
        loop = ControlLoop(robot, truth=arena.state)
        self._place = Place(robot, arena, loop, journal)
        self._apprentice = apprentice
        self._driver = alone or (lambda _: Alone(Driver.NOVICE, self._pupil.novice.alone))
        self._began_s = robot.now()
        self._laps = 0
        loop.arm()

    def teach(self, course: Course, teacher: Teacher | None, laps: int, *, all_laps: bool = False) -> bool:
        """Train until the novice passes every proving run that follows a training lap, or through `all_laps` anyway.

        Returns whether the last ones were passed; False if `laps` were not enough.
        """
        proven = False
        for lap in range(1, laps + 1):
            self.train(course, teacher, lap)
            proven = self._pupil.novice.trained and self.prove(course, lap)
            if proven and not all_laps:
                break
        return proven

    def train(self, course: Course, teacher: Teacher | None, lap: int) -> None:
        """One training lap, numbers counting from 1."""
        self._laps = lap
        self._lap(self._pupil, course.taught(lap), Phase.TRAIN, lap, teacher)
        self._pupil.reset()  # the lap is over: who learns by laps learns now

    def prove(self, course: Course, lap: int = 1) -> bool:
        """The proving runs that belong to a lap, until it is plain how they end. Returns whether enough were passed."""
        failed = 0
        for drives in course.proven(lap):
            failed += not self._alone(drives, Phase.PROVE, lap).passed
            if failed > course.spare:
                return False
        return True

    def show(self, drives: Iterable[Drive], teacher: Teacher | None = None) -> list[LapRecord]:
        """Let the frozen novice drive, each drive a lap of its own; after a crash it goes on behind it.

        The teacher, if there is one, answers a robot that stands in doubt, and takes control as it would in training.
        """
        return [self._alone([drive], Phase.UNSEEN, lap, teacher) for lap, drive in enumerate(drives, start=1)]

    def result(self, converged: bool, proof: str = "own") -> ResultRecord:
        """Sum the session up; `proof` says what `converged` means, as in `fusion.syllabus`."""
        journal = self._place.journal
        return journal.result(
            converged=converged,
            laps=self._laps,
            training_steps=self._training_steps,
            simulated_s=self._place.robot.now() - self._began_s,
            proof=proof,
            contradictions=() if self._apprentice is None else journal.contradictions(self._apprentice.novice),
        )

    @property
    def _pupil(self) -> Method:
        if self._apprentice is None:
            raise ValueError("there is nobody to teach")
        return self._apprentice

    @property
    def _training_steps(self) -> int:
        return 0 if self._apprentice is None else self._apprentice.novice.training_steps

    def _alone(self, drives: Sequence[Drive], phase: Phase, lap: int, teacher: Teacher | None = None) -> LapRecord:
        return self._lap(self._driver(phase), drives, phase, lap, teacher)

    def _lap(
        self, method: Method, drives: Sequence[Drive], phase: Phase, lap: int, teacher: Teacher | None
    ) -> LapRecord:
        tally = Tally()
        began_s = self._place.robot.now()
        for drive in drives:
            ride = Ride(self._place, method, drive, phase, lap, tally, self._apprentice, teacher)
            while ride.goes_on:
                ride.step()
            ride.end()
            if phase == Phase.PROVE and not tally.passed:
                break
        duration_s, steps = self._place.robot.now() - began_s, self._training_steps
        record = lap_record(tally, phase, lap, drives[0].episode.layout, duration_s, self._place.journal, steps)
        self._place.journal.write(record)
        return record
