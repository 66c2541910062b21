"""A session of teaching with an end, on a twin or on a floor. It runs between a person's requests, one step at a time.

| stage | who may drive | ends when |
|---|---|---|
| practice | the hand; nothing is learned | the hand has driven for so long, or asks to go on |
| ready | nobody | a hand is on the controls |
| demonstration, teaching | the method, the hand at any time | the proof is asked for, or a lap passed without help |
| proving | the novice alone, on a twin | this layout and those that it has not seen are driven |
| judging | the novice alone, on a floor | the person says how it went, or takes over: that is a failure |
| verdict | nobody | the person takes the controls to go on, or ends the session |
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Event

import numpy as np

from lira.fusion.control import HELD, ControlLoop, Step
from lira.fusion.learning.learned_policy import LearnedPolicy
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, ResultRecord
from lira.fusion.methods.base import Method
from lira.fusion.operator_service import Answer, OperatorService
from lira.fusion.teaching.session import BLIND_M, Drive, Tally, after_crash, lap_record
from lira.hal.messages import (
    Applied,
    Call,
    Driver,
    Episode,
    OperatorRequest,
    Phase,
    Reason,
    Request,
    SessionState,
    Stage,
)
from lira.hal.port import Arena, Robot
from lira.tools.live.classroom import Classroom
from lira.tools.live.hand import Hand
from lira.tools.live.verdict import has_passed, judged_words, verdict_words
from lira.tools.runs.course import Course
from lira.tools.runs.teach import Say

REPORT_S = 0.5
_GO_ON = (Request.RESUME, Request.PAUSE)  # the same button


@dataclass(frozen=True, slots=True)
class Rules:
    """`practice_s` of driving come first. `person` is who teaches. At most so many `laps` are taught."""

    practice_s: float = 0.0
    person: str = ""
    laps: int = 100


class LiveSession:
    """One sitting of a person. Without an arena (on a floor) the person says when a lap is over, and how it went."""

    def __init__(
        self,
        robot: Robot,
        arena: Arena | None,
        course: Course | None,
        loop: ControlLoop,
        classroom: Classroom,
        journal: Journal,
        hand: Hand,
        rules: Rules,
        say: Say,
        publish: Callable[[SessionState], None],
        explain: Callable[[Applied], str],
    ) -> None:
        self._robot, self._arena, self._course, self.loop = robot, arena, course, loop
        self._classroom, self._journal, self._hand, self._rules = classroom, journal, hand, rules
        self._say, self._publish, self._explain = say, publish, explain
        self._state = SessionState(robot.now(), Stage.PRACTICE, rules.person)
        self._shown_s = -REPORT_S
        self._asked: Request | None = None  # what ends the present lap
        self._proof: list[LapRecord] = []
        self._episode = Episode()
        self._was_there = False  # whether a hand was on the controls in this session
        self._reason: Reason | None = Reason.OK
        self._began_s = robot.now()
        self.converged = False
        self.service: OperatorService | None = None
        self.stop = Event()

    def take(self, asked: OperatorRequest) -> Answer | None:
        """Answer what a session answers, by the stage that it is at; None for the rest."""
        request, stage = asked.request, self._state.stage
        if request is Request.FINISH or (request is Request.PROVE and stage is Stage.VERDICT):
            self._asked = Request.FINISH
            return True, "the session ends"
        if stage is Stage.PRACTICE and request in _GO_ON:
            self._asked = Request.RESUME
            return True, "practice is over"
        if stage is Stage.VERDICT and request in _GO_ON:
            self._asked = Request.RESUME
            return True, "teaching goes on"
        if stage is Stage.JUDGING and request in (Request.PROVE, Request.PASSED, Request.RESET, Request.FAILED):
            passed = request in (Request.PROVE, Request.PASSED)
            self._asked = Request.PASSED if passed else Request.FAILED
            return True, "noted: passed" if passed else "noted: failed"
        if request is Request.UNDO:
            return self._undo()
        if request is Request.PROVE:
            return self._ask_for_proof()
        if request in (Request.PASSED, Request.FAILED):
            return False, "there is nothing to judge now"
        if request is Request.RESET and stage in (Stage.DEMONSTRATION, Stage.TEACHING, Stage.PROVING):
            self._asked = Request.RESET
            return True, "a new lap" if self._arena is None else "a new lap, from the start"
        return None

    def run(self) -> None:
        """Go through the stages until the session ends or is stopped."""
        if self._rules.practice_s > 0.0:
            self._practise()
        while not self._is_over and self._state.laps < self._rules.laps:
            lap = self._teach()
            if self._is_over:
                break
            unaided = lap is not None and lap.passed and lap.unassisted and self._course is not None
            if self._novice.trained and (self._asked is Request.PROVE or unaided):
                self._prove()
                self._await_word()
        self._show(Stage.OVER)

    def result(self) -> ResultRecord:
        """Sum the session up. Contradictions are for whoever knows the log."""
        ledger = self._journal.ledger
        return ResultRecord(
            converged=self.converged,
            laps=self._state.laps,
            human_labels=ledger.labels.stored_human,
            demonstration=ledger.labels.demonstration,
            interventions=ledger.interventions,
            calls=ledger.calls,
            buffer=ledger.buffer,
            training_steps=self._novice.training_steps,
            simulated_s=self._robot.now() - self._began_s,
            elapsed_s=self._journal.elapsed_s,
            account=ledger.account,
            proof="own",
        )

    @property
    def words(self) -> str:
        """The newest verdict; empty if there was none."""
        return self._state.words

    @property
    def _novice(self) -> LearnedPolicy:
        return self._classroom.method.novice

    @property
    def _is_over(self) -> bool:
        return self.stop.is_set() or self._asked is Request.FINISH

    # The stages

    def _practise(self) -> None:
        """The hand drives as it likes."""
        self._show(Stage.PRACTICE)
        self._put(Episode(self._layout(1)))
        self._say(f"practice: hold the dead-man and drive for {self._rules.practice_s:.0f} s; nothing is learned")
        driven_s, before_s = 0.0, self._robot.now()
        self._asked = None
        while not self._is_over and self._asked is None and driven_s < self._rules.practice_s:
            self._idle()
            now_s = self._robot.now()
            driven_s += (now_s - before_s) * self._hand.holds
            before_s = now_s
            state = None if self._arena is None else self.loop.truth()
            if state is not None and (state.collided or state.lost or state.finished):
                self._put(self._episode)
        self._asked = self._asked if self._is_over else None

    def _await_hand(self) -> None:
        """Nothing drives off before a hand was on the controls."""
        self._show(Stage.READY)
        self._say("ready: put your hand on the dead-man; from then on it drives and learns")
        while not self._is_over and not self._hand.holds:
            self._idle()
        self._was_there = True

    def _teach(self) -> LapRecord | None:
        """A lap of teaching; None if it was cut off."""
        number = self._state.laps + 1
        self._state = replace(self._state, laps=number, proven=0, shown=0)
        self._proof = []
        drive = None if self._course is None else self._course.taught(number)[0]
        return self._lap(self._classroom.method, drive, Phase.TRAIN, number)

    def _prove(self) -> None:
        """The novice alone: on a twin here and on unseen layouts, on a floor as the person judges."""
        method, number = self._classroom.method, self._state.laps
        if self._course is None:
            self._show(Stage.JUDGING)
            self._say("judge it: it drives alone. Passed or failed? To take over is a failure")
            self._note_proof(self._lap(method.alone(Phase.PROVE), None, Phase.PROVE, number))
            passed = sum(lap.passed for lap in self._proof)
            self.converged = bool(self._proof) and passed == len(self._proof)
            words = judged_words(passed, len(self._proof))
        else:
            self._show(Stage.PROVING)
            runs = [(Phase.PROVE, drive) for drive in self._course.taught(number)]
            runs += [(Phase.UNSEEN, drive) for drive in self._course.shown()]
            self._proof = []
            self._say(f"proof: the novice alone here, and on {len(runs) - 1} layouts that it has not seen; hands off")
            for place, (phase, drive) in enumerate(runs, start=1):
                if not self._note_proof(self._lap(method.alone(phase), drive, phase, place)) and phase == Phase.PROVE:
                    break
                if self._is_over or self._asked is not None:
                    break
            self.converged = len(self._proof) == len(runs) and has_passed(self._proof)
            words = verdict_words(self._proof)
        self._state = replace(self._state, words=words)
        self._say(f"verdict: {words}. {'It passed' if self.converged else 'Not yet'}: stop, or go on?")

    def _note_proof(self, lap: LapRecord | None) -> bool:
        if lap is None:
            return False
        self._proof.append(lap)
        proven = sum(each.passed for each in self._proof)
        self._state = replace(self._state, proven=proven, shown=len(self._proof))
        return lap.passed

    def _await_word(self) -> None:
        """Stand until the person says whether to stop or to go on; a hand on the controls goes on."""
        if self._is_over:
            return
        self._asked = None
        self._show(Stage.VERDICT)
        while not self._is_over and self._asked is None and not self._hand.holds:
            self._idle()

    # A lap

    def _lap(self, method: Method, drive: Drive | None, phase: Phase, number: int) -> LapRecord | None:
        """Drive one lap and write it down; None if a request or the end of the session cut it off."""
        tally, self._asked = Tally(), None
        self._begin(method, Episode() if drive is None else drive.episode)
        if not self._was_there:
            self._await_hand()
        began_s = self._robot.now()
        over = False
        while not over:
            self._serve(method)
            if self._is_over or self._asked is not None:
                break
            step = self._step(method)
            if step is not None:
                self._note(step, tally, phase, number)
            over = self._look(step, method, drive, phase, tally, began_s)
        if not over and not (drive is None and self._asked in (Request.PASSED, Request.FAILED, Request.RESET)):
            return None
        if drive is None:
            tally.unfinished += self._asked is Request.FAILED or (phase == Phase.PROVE and tally.human_steps > 0)
        record = lap_record(
            tally,
            phase,
            number,
            self._episode.layout,
            self._robot.now() - began_s,
            self._journal,
            self._novice.training_steps,
        )
        self._journal.write(record)
        if phase == Phase.TRAIN:
            self._classroom.method.reset()  # who learns by laps learns now
            self._count_lap(tally, record)
        return record

    def _look(
        self, step: Step | None, method: Method, drive: Drive | None, phase: Phase, tally: Tally, began_s: float
    ) -> bool:
        """Whether the lap is over, after this step; a twin's robot is put back after a crash in training."""
        helped = step is not None and step.lesson.choice.driver == Driver.HUMAN
        if phase != Phase.TRAIN and helped:
            tally.unfinished += 1
            return True
        if drive is None or self._arena is None:
            return False
        state = self.loop.truth()
        if state is None:
            return False
        if np.isfinite(state.lateral_m) and step is not None:
            tally.lateral_m.append(state.lateral_m)
        blind = step is None and state.clearance_m < BLIND_M
        if state.collided or state.lost or blind:
            tally.collisions += state.collided or blind
            tally.lost += state.lost
            if phase != Phase.TRAIN:
                return True
            self._state = replace(
                self._state,
                collisions=self._state.collisions + (state.collided or blind),
                lost=self._state.lost + state.lost,
            )
            self._begin(method, after_crash(drive.episode, state, phase))
            return False
        if state.finished:
            return True
        late = phase != Phase.TRAIN and self._robot.now() > began_s + drive.limit_s
        tally.unfinished += late
        return late

    def _note(self, step: Step, tally: Tally, phase: Phase, number: int) -> None:
        tally.steps += 1
        tally.human_steps += step.lesson.choice.driver == Driver.HUMAN
        stands = phase != Phase.TRAIN and step.proposal.choice.call is Call.FEEDBACK
        tally.stops += stands
        layout, steps = self._episode.layout, self._novice.training_steps
        self._journal.note(step, phase=phase, lap=number, layout=layout, training_steps=steps)
        if phase == Phase.TRAIN:
            beginning = step.proposal.choice.driver == Driver.NOBODY
            self._show(Stage.DEMONSTRATION if beginning else Stage.TEACHING)
        else:
            self._show(self._state.stage)

    def _step(self, method: Method) -> Step | None:
        step = self.loop.step(method)
        reason = None if step is None else step.applied.reason
        if reason is not self._reason:
            self._say(self._stands(step))
            self._reason = reason
        # In a proof on a twin nobody's hand is there to arm it, and nothing is in its way but what it hits.
        stopped = reason in HELD and reason is not Reason.ESTOP
        if stopped and self._arena is not None and self._state.stage is Stage.PROVING:
            self.loop.arm()
        return step

    def _stands(self, step: Step | None) -> str:
        if step is None:
            return f"standing still: {self.loop.trouble}"
        return "driving" if step.applied.reason is Reason.OK else self._explain(step.applied)

    def _begin(self, method: Method, episode: Episode) -> None:
        self._put(episode)
        self._journal.ledger.new_episode()
        method.reset()
        self.loop.arm()

    def _put(self, episode: Episode) -> None:
        """Put a twin's robot down; on a floor it is where it is."""
        self._episode = episode
        if self._arena is not None:
            self.loop.stand()
            self._arena.reset(episode)
        self._show(self._state.stage)

    def _idle(self) -> None:
        """Stand for one period and hear what is asked."""
        if self.service is not None:
            self.service.serve()
        self.loop.stand()
        self._show(self._state.stage)

    def _serve(self, method: Method) -> None:
        """Hear what is asked; while it is paused, stand."""
        if self.loop.restarted():
            method.reset()
            self._journal.ledger.new_episode()
            self._say("the robot was started anew; what was learned goes on")
        if self.service is None:
            return
        self.service.serve()
        while self.service.paused and not self._is_over and self._asked is None:
            self._idle()

    # Requests

    def _ask_for_proof(self) -> Answer:
        if self._state.stage not in (Stage.DEMONSTRATION, Stage.TEACHING):
            return False, "nothing is taught now"
        if not self._novice.trained:
            return False, "it has learned nothing yet"
        self._asked = Request.PROVE
        return True, "the novice alone, to prove what it can: hands off"

    def _undo(self) -> Answer:
        if self._state.stage not in (Stage.DEMONSTRATION, Stage.TEACHING, Stage.VERDICT):
            return False, "not now: while it is taught, or at the verdict"
        done, words = self._classroom.undo(self._journal.ledger)
        if done:
            if self.service is not None:
                self.service.change_method(self._classroom.method)
            if self._state.stage is not Stage.VERDICT:
                self._asked = Request.UNDO  # the lap begins anew, with who has unlearned
        return done, words

    # What is told

    def _layout(self, number: int) -> int:
        return 0 if self._course is None else self._course.taught(number)[0].episode.layout

    def _count_lap(self, tally: Tally, record: LapRecord) -> None:
        alone = 1.0 - tally.human_steps / max(1, tally.steps)
        curve = (*self._state.curve, alone)[-100:]
        self._state = replace(self._state, passed=self._state.passed + record.passed, curve=curve)
        self._say(
            f"lap {record.lap}: {'passed' if record.passed else 'not passed'}, {alone:.0%} driven without you, "
            f"collisions {record.collisions}, lost {record.lost}, {record.human_labels} labels of yours"
        )

    def _show(self, stage: Stage) -> None:
        """Tell how it goes, at once if the stage is another one, else now and then."""
        now_s = time.monotonic()
        if stage is self._state.stage and now_s < self._shown_s + REPORT_S:
            return
        self._shown_s = now_s
        ledger = self._journal.ledger
        account, labels = ledger.account, ledger.labels
        self._state = replace(
            self._state,
            stamp_s=self._robot.now(),
            stage=stage,
            layout=self._episode.layout,
            labels=labels.stored_human + labels.demonstration,
            calls=account.call_episodes,
            answered=account.answered,
            alone=1.0 - account.human_steps / account.steps if account.steps else 0.0,
        )
        self._publish(self._state)
