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

from collections.abc import Callable
from dataclasses import dataclass
from threading import Event

from lira.fusion.control import HELD, ControlLoop, Step
from lira.fusion.learning.learned_policy import LearnedPolicy
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, ResultRecord
from lira.fusion.methods.base import Method
from lira.fusion.operator_service import Answer, OperatorService
from lira.fusion.teaching.session import Drive, Tally, after_crash, lap_record
from lira.hal.messages import (
    Applied,
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
from lira.tools.live.board import Board
from lira.tools.live.classroom import Classroom
from lira.tools.live.hand import Hand
from lira.tools.live.lap import Fate, count, fate, is_helped
from lira.tools.live.requests import TAUGHT, reply
from lira.tools.live.verdict import has_passed, judged_words, verdict_words
from lira.tools.runs.course import Course
from lira.tools.runs.progress import Say


@dataclass(frozen=True, slots=True)
class Rules:
    """`practice_s` of driving come first. `person` is who teaches. At most so many `laps` are taught, and
    for so many `minutes`; with those a proof that was passed ends the session, unless it takes the `whole_time`.
    """

    practice_s: float = 0.0
    person: str = ""
    laps: int = 100
    minutes: float | None = None
    whole_time: bool = False


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
        self._say, self._explain = say, explain
        self.board = Board(rules.person, journal.ledger, robot.now, publish, say)
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
        """Answer what a session answers; None to the rest."""
        replied = reply(asked.request, self.board.stage, trained=self._novice.trained)
        if replied is not None:
            self._asked = replied.ends or self._asked
            return replied.answer
        return self._undo() if asked.request is Request.UNDO else None

    def run(self) -> None:
        """Go through the stages until the session ends or is stopped."""
        if self._rules.practice_s > 0.0:
            self._practise()
        while not self._is_over() and self.board.state.laps < self._rules.laps:
            lap = self._teach()
            if self._is_over():
                break
            unaided = lap is not None and lap.passed and lap.unassisted and self._course is not None
            if self._novice.trained and (self._asked is Request.PROVE or unaided):
                self._prove()
                if self._rules.minutes is None:
                    self._await_word()
                elif self.converged and not self._rules.whole_time:
                    break
        self._show(Stage.OVER)

    def result(self) -> ResultRecord:
        """Sum the session up. Contradictions are for whoever knows the log."""
        ledger = self._journal.ledger
        return ResultRecord(
            converged=self.converged,
            laps=self.board.state.laps,
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
        return self.board.state.words

    @property
    def _novice(self) -> LearnedPolicy:
        return self._classroom.method.novice

    def _is_over(self) -> bool:
        return self.stop.is_set() or self._asked is Request.FINISH or self._is_late()

    def _is_late(self) -> bool:
        """Whether the time for teaching is up; a proof that was begun is driven to its end."""
        minutes, stage = self._rules.minutes, self.board.stage
        taught = stage not in (Stage.PRACTICE, Stage.READY, Stage.PROVING, Stage.JUDGING)
        return minutes is not None and taught and self._robot.now() > self._began_s + 60.0 * minutes

    # The stages

    def _practise(self) -> None:
        """The hand drives as it likes."""
        self._show(Stage.PRACTICE)
        self._put(Episode(self._layout(1)))
        self._say(f"practice: hold the dead-man and drive for {self._rules.practice_s:.0f} s; nothing is learned")
        driven_s, before_s = 0.0, self._robot.now()
        self._asked = None
        while not self._is_over() and self._asked is None and driven_s < self._rules.practice_s:
            self._idle()
            now_s = self._robot.now()
            driven_s += (now_s - before_s) * self._hand.holds
            before_s = now_s
            state = None if self._arena is None else self.loop.truth()
            if state is not None and (state.collided or state.lost or state.finished):
                self._put(self._episode)
        self._asked = self._asked if self._is_over() else None

    def _await_hand(self) -> None:
        """Nothing drives off before a hand was on the controls."""
        self._show(Stage.READY)
        self._say("ready: put your hand on the dead-man; from then on it drives and learns")
        while not self._is_over() and not self._hand.holds:
            self._idle()
        self._was_there = True
        self._began_s = self._robot.now()

    def _teach(self) -> LapRecord | None:
        """A lap of teaching; None if it was cut off."""
        number, self._proof = self.board.begin_lap(), []
        drive = None if self._course is None else self._course.taught(number)[0]
        return self._lap(self._classroom.method, drive, Phase.TRAIN, number)

    def _prove(self) -> None:
        """The novice alone: on a twin here and on unseen layouts, on a floor as the person judges."""
        method, number = self._classroom.method, self.board.state.laps
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
                if self._is_over() or self._asked is not None:
                    break
            self.converged = len(self._proof) == len(runs) and has_passed(self._proof)
            words = verdict_words(self._proof)
        self.board.note_proof(self._proof, words)
        self._say(f"verdict: {words}. {'It passed' if self.converged else 'Not yet'}: stop, or go on?")

    def _note_proof(self, lap: LapRecord | None) -> bool:
        if lap is None:
            return False
        self._proof.append(lap)
        self.board.note_proof(self._proof)
        return lap.passed

    def _await_word(self) -> None:
        """Stand until the person says whether to stop or to go on; a hand on the controls goes on."""
        if self._is_over():
            return
        self._asked = None
        self._show(Stage.VERDICT)
        while not self._is_over() and self._asked is None and not self._hand.holds:
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
            if self._is_over() or self._asked is not None:
                break
            step = self._step(method)
            if step is not None:
                self._note(step, tally, phase, number)
            over = self._look(step, method, drive, (phase, tally, began_s))
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
            self.board.end_lap(tally, record)
        return record

    def _look(self, step: Step | None, method: Method, drive: Drive | None, lap: tuple[Phase, Tally, float]) -> bool:
        """Whether the lap is over, after this step; a twin's robot is put back after a crash in training."""
        phase, tally, began_s = lap
        if is_helped(step, phase):
            tally.unfinished += 1
            return True
        state = None if drive is None else self.loop.truth()
        if drive is None or state is None:
            return False
        late = self._robot.now() > began_s + drive.limit_s
        found = fate(state, tally, phase, blind=step is None, late=late)
        if found is Fate.PUT_BACK:
            self._begin(method, after_crash(drive.episode, state, phase))
        return found is Fate.OVER

    def _note(self, step: Step, tally: Tally, phase: Phase, number: int) -> None:
        count(step, tally, phase)
        layout, steps = self._episode.layout, self._novice.training_steps
        self._journal.note(step, phase=phase, lap=number, layout=layout, training_steps=steps)
        if phase == Phase.TRAIN:
            beginning = step.proposal.choice.driver == Driver.NOBODY
            self._show(Stage.DEMONSTRATION if beginning else Stage.TEACHING)
        else:
            self._show(self.board.stage)

    def _step(self, method: Method) -> Step | None:
        step = self.loop.step(method)
        reason = None if step is None else step.applied.reason
        if reason is not self._reason:
            self._say(self._stands(step))
            self._reason = reason
        # In a proof on a twin nobody's hand is there to arm it, and nothing is in its way but what it hits.
        stopped = reason in HELD and reason is not Reason.ESTOP
        if stopped and self._arena is not None and self.board.stage is Stage.PROVING:
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
        self._show(self.board.stage)

    def _idle(self) -> None:
        """Stand for one period and hear what is asked."""
        if self.service is not None:
            self.service.serve()
        self.loop.stand()
        self._show(self.board.stage)

    def _serve(self, method: Method) -> None:
        """Hear what is asked; while it is paused, stand."""
        if self.loop.restarted():
            method.reset()
            self._journal.ledger.new_episode()
            self._say("the robot was started anew; what was learned goes on")
        if self.service is None:
            return
        self.service.serve()
        while self.service.paused and not self._is_over() and self._asked is None:
            self._idle()

    def _undo(self) -> Answer:
        done, words = self._classroom.undo(self._journal.ledger)
        if done:
            if self.service is not None:
                self.service.change_method(self._classroom.method)
            if self.board.stage in TAUGHT:
                self._asked = Request.UNDO  # the lap begins anew, with who has unlearned
        return done, words

    def _layout(self, number: int) -> int:
        return 0 if self._course is None else self._course.taught(number)[0].episode.layout

    def _show(self, stage: Stage) -> None:
        self.board.show(stage, self._episode.layout)
