"""A course of teaching on a twin: laps with the teacher, a proving run after each, then layouts never seen."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np

from lira.fusion.control import HELD, ControlLoop, Step, Teacher
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, ResultRecord
from lira.fusion.methods.base import Alone, Method
from lira.hal.errors import DeviceError
from lira.hal.messages import Call, CourseState, Driver, Episode, Phase
from lira.hal.port import Arena, Robot

PUT_BACK_M = 2.0  # after a crash in training the robot starts again this far before it
PUT_ON_M = 1.0  # and on an unseen layout this far behind it
LOST_OBSERVATIONS = 50  # unusable observations in a row that end a session
BLIND_M = 0.3  # so close to a box the camera may see nothing but that: a crash, and no broken sensor


@dataclass(frozen=True, slots=True)
class Drive:
    """One episode and when it counts as passed.

    It ends at the finish or after `limit_s`. `goal` is what it takes: "finish" (and never to lose the line), "leave"
    (to get out of the world, on whichever side) or "stay" (to hit nothing). `final_lateral_m` bounds how far from the
    line it may end.
    """

    episode: Episode
    limit_s: float
    goal: Literal["finish", "leave", "stay"] = "finish"
    final_lateral_m: float = float("inf")


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


@dataclass(slots=True)
class Tally:
    """What happened in one lap."""

    steps: int = 0
    human_steps: int = 0
    collisions: int = 0
    lost: int = 0
    unfinished: int = 0
    stops: int = 0
    shielded: int = 0
    lateral_m: list[float] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Unharmed and to the end."""
        return self.collisions + self.lost + self.unfinished == 0


def lap_record(
    tally: Tally, phase: Phase, lap: int, layout: int, duration_s: float, journal: Journal, training_steps: int
) -> LapRecord:
    """What is written down at the end of a lap."""
    ledger = journal.ledger
    return LapRecord(
        phase=phase,
        lap=lap,
        layout=layout,
        passed=tally.passed,
        unassisted=tally.human_steps == 0,
        duration_s=duration_s,
        collisions=tally.collisions,
        lost=tally.lost,
        lateral_rms_m=float(np.sqrt(np.mean(np.square(tally.lateral_m)))) if tally.lateral_m else None,
        human_labels=ledger.labels.stored_human,
        interventions=ledger.interventions,
        calls=ledger.calls,
        buffer=ledger.buffer,
        training_steps=training_steps,
        elapsed_s=journal.elapsed_s,
        stops=tally.stops,
        shielded=tally.shielded,
    )


class Session:
    """Teaches one apprentice on one robot.

    `alone` says who drives in a phase without the teacher: the novice, if it is not given. Without
    an apprentice there is nobody to teach, only `alone` to be shown.
    """

    def __init__(
        self,
        robot: Robot,
        arena: Arena,
        loop: ControlLoop,
        journal: Journal,
        apprentice: Method | None,
        alone: Callable[[Phase], Method] | None = None,
    ) -> None:
        self._robot = robot
        self._arena = arena
        self._loop = loop
        self._journal = journal
        self._apprentice = apprentice
        self._driver = alone or (lambda _: Alone(Driver.NOVICE, self._pupil.novice.alone))
        self._began_s = robot.now()
        self._laps = 0

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

    def score(self, runs: Sequence[Sequence[Drive]], lap: int) -> list[LapRecord]:
        """Proving runs after a lap, whatever becomes of the others."""
        return [self._alone(drives, Phase.PROVE, lap) for drives in runs]

    def show(self, drives: Iterable[Drive], teacher: Teacher | None = None) -> list[LapRecord]:
        """Let the frozen novice drive, each drive a lap of its own; after a crash it goes on behind it.

        The teacher, if there is one, answers a robot that stands in doubt, and takes control as it would in training.
        """
        return [self._alone([drive], Phase.UNSEEN, lap, teacher) for lap, drive in enumerate(drives, start=1)]

    def result(self, converged: bool, proof: str = "own") -> ResultRecord:
        """Sum the session up; `proof` says what `converged` means, as in `fusion.syllabus`."""
        ledger = self._journal.ledger
        return ResultRecord(
            converged=converged,
            laps=self._laps,
            human_labels=ledger.labels.stored_human,
            demonstration=ledger.labels.demonstration,
            interventions=ledger.interventions,
            calls=ledger.calls,
            buffer=ledger.buffer,
            training_steps=self._training_steps,
            simulated_s=self._robot.now() - self._began_s,
            elapsed_s=self._journal.elapsed_s,
            account=ledger.account,
            proof=proof,
            contradictions=() if self._apprentice is None else self._journal.contradictions(self._apprentice.novice),
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
        began_s = self._robot.now()
        for drive in drives:
            self._drive(method, drive, phase, lap, teacher, tally)
            if phase == Phase.PROVE and not tally.passed:
                break
        duration_s, steps = self._robot.now() - began_s, self._training_steps
        record = lap_record(tally, phase, lap, drives[0].episode.layout, duration_s, self._journal, steps)
        self._journal.write(record)
        return record

    def _drive(
        self, method: Method, drive: Drive, phase: Phase, lap: int, teacher: Teacher | None, tally: Tally
    ) -> None:
        """One episode, with the robot put back after a crash unless this is a proving run."""
        self._begin(drive.episode, method, teacher)
        end_s = self._robot.now() + drive.limit_s
        state = self._arena.state()
        stood = False
        while not state.finished and self._robot.now() < end_s:
            step = self._step(method, teacher)
            if step is None:
                tally.collisions += 1
                if phase == Phase.PROVE:
                    return
                self._begin(after_crash(drive.episode, self._arena.state(), phase), method, teacher)
                continue
            self._journal.note(
                step,
                phase=phase,
                lap=lap,
                layout=drive.episode.layout,
                training_steps=self._training_steps,
            )
            tally.steps += 1
            tally.human_steps += step.lesson.choice.driver == Driver.HUMAN
            tally.shielded += step.proposal.choice.driver == Driver.SHIELD
            stands = phase != Phase.TRAIN and step.proposal.choice.call is Call.FEEDBACK
            tally.stops += stands and not stood
            stood = stands
            if stands and phase == Phase.PROVE:  # nobody is there to answer
                tally.unfinished += 1
                return
            state = self._arena.state()
            if np.isfinite(state.lateral_m):
                tally.lateral_m.append(state.lateral_m)
            if state.lost and drive.goal != "finish":
                break
            if state.collided or state.lost:
                tally.collisions += state.collided
                tally.lost += state.lost
                if phase == Phase.PROVE:
                    return
                self._begin(after_crash(drive.episode, state, phase), method, teacher)
        out = state.finished or (drive.goal == "leave" and state.lost)
        tally.unfinished += drive.goal != "stay" and not out
        tally.unfinished += bool(abs(np.nan_to_num(state.lateral_m)) > drive.final_lateral_m)

    def _begin(self, episode: Episode, method: Method, teacher: Teacher | None) -> None:
        self._arena.reset(episode)
        self._journal.ledger.new_episode()
        method.reset()
        if teacher is not None:
            teacher.reset(episode.layout)

    def _step(self, method: Method, teacher: Teacher | None) -> Step | None:
        """Return the next step; None where the robot stands before a box and sees nothing. Raises `DeviceError`."""
        for _ in range(LOST_OBSERVATIONS):
            if self._loop.restarted():
                raise DeviceError("the robot was started anew in the middle of a lap", "Begin anew, in another --run.")
            step = self._loop.step(method, teacher)
            if step is None:
                continue
            if step.applied.reason in HELD:  # a busy machine was silent for too long; nobody else is here to arm it
                self._loop.arm()
            return step
        if self._arena.state().clearance_m < BLIND_M:
            return None
        raise DeviceError(
            f"{LOST_OBSERVATIONS} observations in a row could not be used; the last: {self._loop.trouble}",
            "Check the lidar and the camera.",
        )


def after_crash(episode: Episode, state: CourseState, phase: Phase) -> Episode:
    """Where the robot is put down after a crash to go on with the lap: before it to try again, or behind it."""
    if not np.isfinite(state.progress_m):
        return episode
    shift = -PUT_BACK_M if phase == Phase.TRAIN else PUT_ON_M
    return Episode(episode.layout, start_m=max(0.0, state.progress_m + shift), began_m=episode.start_m)
