"""A session of teaching with an end, on a twin or on a floor. It runs between a person's requests, one step at a time.

| stage | who may drive | ends when |
|---|---|---|
| practice | the hand; nothing is learned | the hand has driven for so long, or asks to go on |
| ready | nobody | a hand is on the controls |
| demonstration, teaching | the method, the hand at any time | the proof is asked for, or a lap passed without help |
| proving | the novice alone, on a twin | the layout that was taught is driven |
| exam | the novice alone, in a twin of its own | layouts that it has not seen are driven |
| judging | the novice alone, on a floor | the person says how it went, or takes over: that is a failure |
| verdict | nobody | the person takes the controls to go on, or ends the session |
"""

from collections.abc import Sequence

from lira.fusion.learning.learned_policy import LearnedPolicy
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, ResultRecord
from lira.fusion.operator_service import Answer
from lira.hal.messages import Episode, OperatorRequest, Phase, Request, Stage
from lira.hal.words import plural
from lira.tools.live.classroom import Classroom
from lira.tools.live.exam import Exam
from lira.tools.live.lap_driver import LapDriver
from lira.tools.live.lessons import Lessons
from lira.tools.live.requests import TAUGHT, reply
from lira.tools.live.rules import Rules
from lira.tools.live.verdict import has_passed, judged_words, verdict_words
from lira.tools.runs.course import Course
from lira.tools.runs.progress import Say

MOMENT_S = 3.0  # a lap that is cut off so soon was none


class LiveSession:
    """One sitting of a person; without a `course` on a floor."""

    def __init__(
        self,
        driver: LapDriver,
        course: Course | None,
        classroom: Classroom,
        journal: Journal,
        rules: Rules,
        say: Say,
    ) -> None:
        self._driver, self.board = driver, driver.board
        self._course, self._classroom, self._journal, self._rules, self._say = course, classroom, journal, rules, say
        self._lessons = Lessons(0 if course is None else course.layout, classroom.before.layouts)
        self._proof: list[LapRecord] = []
        self.converged = False

    def take(self, asked: OperatorRequest) -> Answer | None:
        """Answer what a session answers; None to the rest."""
        replied = reply(asked.request, self.board.stage, trained=self._novice.trained)
        if replied is not None:
            self._driver.asked = replied.ends or self._driver.asked
            return replied.answer
        return self._undo() if asked.request is Request.UNDO else None

    def run(self) -> None:
        """Go through the stages until the session ends or is stopped."""
        driver, first = self._driver, self.board.state.laps
        if self._rules.practice_s > 0.0:
            self._practise()
        while not driver.is_over() and self.board.state.laps - first < self._rules.laps:
            lap = self._teach(self._lessons.layout)
            if driver.is_over():
                break
            unaided = lap is not None and lap.passed and lap.unassisted and self._course is not None
            if self._novice.trained and (driver.asked is Request.PROVE or unaided):
                self._prove(self._lessons.taught)
                if self._rules.minutes is None:
                    self._await_word()
                elif self.converged and not self._rules.whole_time:
                    break
        driver.show(Stage.OVER)

    def result(self) -> ResultRecord:
        """Sum the session up. Contradictions are for whoever knows the log."""
        return self._journal.result(
            converged=self.converged,
            laps=self.board.state.laps,
            training_steps=self._novice.training_steps,
            simulated_s=self._driver.now() - self._driver.began_s,
            proof="own",
        )

    @property
    def words(self) -> str:
        """The newest verdict; empty if there was none."""
        return self.board.state.words

    @property
    def _novice(self) -> LearnedPolicy:
        return self._classroom.method.novice

    def _practise(self) -> None:
        """The hand drives as it likes."""
        driver = self._driver
        driver.show(Stage.PRACTICE)
        driver.put(Episode(self._lessons.layout))
        self._say(f"practice: hold the dead-man and drive for {self._rules.practice_s:.0f} s; nothing is learned")
        driven_s, before_s, driver.asked = 0.0, driver.now(), None
        while not driver.is_over() and driver.asked is None and driven_s < self._rules.practice_s:
            driver.idle()
            now_s = driver.now()
            driven_s += (now_s - before_s) * driver.hand.holds
            before_s = now_s
            state = driver.truth
            if state is not None and (state.collided or state.lost or state.finished):
                driver.put_again()
        driver.asked = driver.asked if driver.is_over() else None

    def _teach(self, layout: int) -> LapRecord | None:
        """A lap of teaching; None if it was cut off."""
        number, self._proof = self.board.begin_lap(), []
        began_s = self._driver.now()
        drive = None if self._course is None else self._course.lap(layout)
        record = self._driver.lap(self._classroom.method, drive, Phase.TRAIN, number)
        if record is None and self._driver.now() < began_s + MOMENT_S:  # asked for the proof as the last lap ended
            self.board.give_back_lap()
        else:
            self._lessons.note_lap(passed=record is not None and record.passed)
        return record

    def _prove(self, layout: int) -> None:
        """The novice alone: on a twin here and on unseen layouts, on a floor as the person judges."""
        self._proof = []
        words = self._judge() if self._course is None else self._examine(self._course, layout)
        self.board.note_proof(self._proof)
        self.board.note_verdict(words, converged=self.converged)
        self._say(f"verdict: {words}. {'It passed' if self.converged else 'Not yet'}: stop, or go on?")

    def _judge(self) -> str:
        self._driver.show(Stage.JUDGING)
        self._say("judge it: it drives alone. Passed or failed? To take over is a failure")
        method = self._classroom.method.alone(Phase.PROVE)
        lap = self._driver.lap(method, None, Phase.PROVE, self.board.state.laps)
        self._proof += [lap] if lap is not None else []
        passed = sum(lap.passed for lap in self._proof)
        self.converged = bool(self._proof) and passed == len(self._proof)
        return judged_words(passed, len(self._proof))

    def _examine(self, course: Course, layout: int) -> str:
        driver, learner, unseen = self._driver, self._classroom.method, self._rules.unseen
        driver.show(Stage.PROVING)
        self._say(f"proof: the novice alone here, then on {plural(unseen, 'layout')} that it has not seen; hands off")
        lap = driver.lap(learner.alone(Phase.PROVE), course.lap(layout), Phase.PROVE, self.board.state.laps)
        self._proof += [lap] if lap is not None else []
        if lap is not None and lap.passed and unseen:
            self._show_unseen(course, self._lessons.draw(unseen))
        self._lessons.note_proof(self._proof)
        self.converged = len(self._proof) == 1 + unseen and has_passed(self._proof)
        return verdict_words(self._proof)

    def _show_unseen(self, course: Course, layouts: Sequence[int]) -> None:
        """Have the novice drive these in a twin of its own, while the robot here stands."""
        driver, own = self._driver, tuple(self._proof)
        drives = [course.lap(layout) for layout in layouts]
        driver.show(Stage.EXAM)
        with Exam(course.profile, course.world, self._classroom.method, drives, self._journal) as exam:
            while exam.goes_on and not driver.is_over() and driver.asked is None:
                driver.idle()
                self.board.note_proof([*own, *exam.laps])
        self._proof += exam.laps

    def _await_word(self) -> None:
        """Stand until the person says whether to stop or to go on; a hand on the controls goes on."""
        driver = self._driver
        if driver.is_over():
            return
        driver.asked = None
        driver.show(Stage.VERDICT)
        while not driver.is_over() and driver.asked is None and not driver.hand.holds:
            driver.idle()

    def _undo(self) -> Answer:
        done, words = self._classroom.undo(self._journal.ledger)
        if done:
            if self._driver.service is not None:
                self._driver.service.change_method(self._classroom.method)
            if self.board.stage in TAUGHT:
                self._driver.asked = Request.UNDO  # the lap begins anew, with who has unlearned
            elif self._proof:  # it was of a novice that knew more
                self.converged, self._proof = False, []
                since = f"{self.words}; since then labels were taken back, and what is left has not been proven"
                self.board.note_verdict(since, converged=False)
        return done, words
