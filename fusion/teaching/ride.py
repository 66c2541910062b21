"""One drive of a lap, decision by decision: how it begins, goes on behind a crash, ends, and is judged."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from lira.fusion.control import HELD, ControlLoop, Sight, Step, Teacher
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord
from lira.fusion.methods.base import Method, Proposal
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


@dataclass(frozen=True, slots=True)
class Place:
    """Where is driven: a robot with its loop, the arena it is in, and the journal of what happens there."""

    robot: Robot
    arena: Arena
    loop: ControlLoop
    journal: Journal


class Ride:
    """An episode as it is driven, step by step while it `goes_on`; what happens is added to `tally`.

    After a crash the robot is put down anew, unless this is a proving run: that one is over. `apprentice` is who learns
    meanwhile, if anybody does.
    """

    def __init__(
        self,
        place: Place,
        method: Method,
        drive: Drive,
        phase: Phase,
        lap: int,
        tally: Tally,
        apprentice: Method | None = None,
        teacher: Teacher | None = None,
    ) -> None:
        self._place = place
        self._method = method
        self._drive, self._phase, self._lap, self.tally = drive, phase, lap, tally
        self._apprentice = apprentice
        self._teacher = teacher
        self._stood = False
        self._unusable = 0  # observations in a row
        self._over, self._failed = False, False
        self._begin(drive.episode)
        self.began_s = place.robot.now()
        self._state = place.arena.state()

    @property
    def goes_on(self) -> bool:
        """Whether another step is to be made."""
        in_time = self._place.robot.now() < self.began_s + self._drive.limit_s
        return not self._over and not self._state.finished and in_time

    def step(self) -> None:
        """Make one decision. Raises `DeviceError` where the robot sees nothing, or was started anew."""
        self._check_robot()
        self._take(self._place.loop.step(self._method, self._teacher))

    def look(self) -> Sight | None:
        """The first half of a step. None where there was nothing to be seen: that was all of it."""
        self._check_robot()
        sight = self._place.loop.look(self._method)
        if sight is None:
            self._take(None)
        return sight

    def follow(self, sight: Sight, proposal: Proposal) -> None:
        """The second half."""
        self._take(self._place.loop.follow(self._method, sight, proposal, self._teacher))

    def end(self) -> None:
        """Judge what does not show before the end."""
        if self._failed:
            return
        state, drive = self._state, self._drive
        out = state.finished or (drive.goal == "leave" and state.lost)
        self.tally.unfinished += drive.goal != "stay" and not out
        self.tally.unfinished += bool(abs(np.nan_to_num(state.lateral_m)) > drive.final_lateral_m)

    def record(self) -> LapRecord:
        """What is written down of a lap that was this drive alone."""
        robot, journal = self._place.robot, self._place.journal
        layout, duration_s = self._drive.episode.layout, robot.now() - self.began_s
        return lap_record(self.tally, self._phase, self._lap, layout, duration_s, journal, self._training_steps)

    @property
    def _training_steps(self) -> int:
        return 0 if self._apprentice is None else self._apprentice.novice.training_steps

    def _begin(self, episode: Episode) -> None:
        self._place.arena.reset(episode)
        self._place.journal.ledger.new_episode()
        self._method.reset()
        if self._teacher is not None:
            self._teacher.reset(episode.layout)

    def _check_robot(self) -> None:
        if self._place.loop.restarted():
            raise DeviceError("the robot was started anew in the middle of a lap", "Begin anew, in another --run.")

    def _take(self, step: Step | None) -> None:
        """Take in what came of a step."""
        if step is None:
            self._saw_nothing()
            return
        self._unusable = 0
        if step.applied.reason in HELD:  # a busy machine was silent for too long; nobody else is here to arm it
            self._place.loop.arm()
        layout, steps = self._drive.episode.layout, self._training_steps
        self._place.journal.note(step, phase=self._phase, lap=self._lap, layout=layout, training_steps=steps)
        if not self._count(step):
            return
        state = self._state = self._place.arena.state()
        if np.isfinite(state.lateral_m):
            self.tally.lateral_m.append(state.lateral_m)
        if state.lost and self._drive.goal != "finish":
            self._over = True
        elif state.collided or state.lost:
            self.tally.collisions += state.collided
            self.tally.lost += state.lost
            self._go_on_behind(state)

    def _count(self, step: Step) -> bool:
        """Count a step. Returns False if it ends a proving run: the novice stands and asks, and nobody is there."""
        tally = self.tally
        tally.steps += 1
        tally.human_steps += step.lesson.choice.driver == Driver.HUMAN
        tally.shielded += step.proposal.choice.driver == Driver.SHIELD
        stands = self._phase != Phase.TRAIN and step.proposal.choice.call is Call.FEEDBACK
        tally.stops += stands and not self._stood
        self._stood = stands
        if stands and self._phase == Phase.PROVE:
            tally.unfinished += 1
            self._over = self._failed = True
        return not self._over

    def _go_on_behind(self, state: CourseState) -> None:
        """After a crash; what has to be proven is not."""
        if self._phase == Phase.PROVE:
            self._over = self._failed = True
        else:
            self._begin(after_crash(self._drive.episode, state, self._phase))

    def _saw_nothing(self) -> None:
        """An observation could not be used. After many it is a crash where the robot stands before a box."""
        self._unusable += 1
        if self._unusable < LOST_OBSERVATIONS:
            return
        state = self._place.arena.state()
        if state.clearance_m >= BLIND_M:
            raise DeviceError(
                f"{LOST_OBSERVATIONS} observations in a row could not be used; the last: {self._place.loop.trouble}",
                "Check the lidar and the camera.",
            )
        self._unusable = 0
        self.tally.collisions += 1
        self._go_on_behind(state)


def abreast(rides: Sequence[Ride], method: Method) -> None:
    """Let one method drive several robots to the end, step by step: what all of them see is answered at once."""
    while going := [ride for ride in rides if ride.goes_on]:
        seeing = [(ride, sight) for ride in going if (sight := ride.look()) is not None]
        proposals = method.propose_all([sight.features for _, sight in seeing])
        for (ride, sight), proposal in zip(seeing, proposals, strict=True):
            ride.follow(sight, proposal)
    for ride in rides:
        ride.end()


def after_crash(episode: Episode, state: CourseState, phase: Phase) -> Episode:
    """Where the robot is put down after a crash to go on with the lap: before it to try again, or behind it."""
    if not np.isfinite(state.progress_m):
        return episode
    shift = -PUT_BACK_M if phase == Phase.TRAIN else PUT_ON_M
    return Episode(episode.layout, start_m=max(0.0, state.progress_m + shift), began_m=episode.start_m)
