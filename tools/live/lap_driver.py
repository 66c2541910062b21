"""Drives a session's laps, one at a time: between a person's requests, and with a hand that may take over."""

from collections.abc import Callable
from threading import Event

from lira.fusion.control import HELD, ControlLoop, Step
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord
from lira.fusion.methods.base import Method
from lira.fusion.operator_service import OperatorService
from lira.fusion.teaching.ride import Drive, Tally, after_crash, lap_record
from lira.hal.messages import Applied, CourseState, Driver, Episode, Phase, Reason, Request, Stage
from lira.hal.port import Arena, Robot
from lira.tools.live.board import Board
from lira.tools.live.classroom import Classroom
from lira.tools.live.hand import Hand
from lira.tools.live.lap import Fate, count, fate, is_helped
from lira.tools.live.rules import Rules
from lira.tools.runs.progress import Say

ENDS_ON_A_FLOOR = frozenset({Request.PASSED, Request.FAILED, Request.RESET})


class LapDriver:
    """Drives, stands and hears. Without an arena (on a floor) the person says when a lap is over, and how it went.

    `asked` is what ends the present lap, `stop` what ends the session; `service` hears the requests.
    """

    def __init__(
        self,
        robot: Robot,
        arena: Arena | None,
        loop: ControlLoop,
        classroom: Classroom,
        journal: Journal,
        hand: Hand,
        rules: Rules,
        board: Board,
        say: Say,
        explain: Callable[[Applied], str],
    ) -> None:
        self._robot, self._arena, self._loop = robot, arena, loop
        self._classroom, self._journal, self.hand, self._rules = classroom, journal, hand, rules
        self.board, self._say, self._explain = board, say, explain
        self.asked: Request | None = None
        self.stop = Event()
        self.service: OperatorService | None = None
        self.began_s = robot.now()  # of the teaching
        self._episode = Episode()
        self._was_there = False  # whether a hand was on the controls in this session
        self._reason: Reason | None = Reason.OK

    def is_over(self) -> bool:
        """Whether the session is: ended, stopped, or out of time."""
        late = self._rules.is_late(self.board.stage, self._robot.now() - self.began_s)
        return late or self.stop.is_set() or self.asked is Request.FINISH

    @property
    def truth(self) -> CourseState | None:
        """Where a twin's robot is; None on a floor."""
        return None if self._arena is None else self._loop.truth()

    def now(self) -> float:
        """Seconds on the robot's clock."""
        return self._robot.now()

    def show(self, stage: Stage) -> None:
        """Tell where the session is."""
        self.board.show(stage, self._episode.layout)

    def put(self, episode: Episode) -> None:
        """Put a twin's robot down; on a floor it is where it is."""
        self._episode = episode
        if self._arena is not None:
            self._loop.stand()
            self._arena.reset(episode)
        self.show(self.board.stage)

    def put_again(self) -> None:
        """The same once more."""
        self.put(self._episode)

    def idle(self) -> None:
        """Stand for one period and hear what is asked."""
        if self.service is not None:
            self.service.serve()
        self._loop.stand()
        self.show(self.board.stage)

    def lap(self, method: Method, drive: Drive | None, phase: Phase, number: int) -> LapRecord | None:
        """Drive one lap and write it down; None if a request or the end of the session cut it off."""
        tally, self.asked = Tally(), None
        self._begin(method, Episode() if drive is None else drive.episode)
        if not self._was_there:
            self._await_hand()
        began_s, over = self._robot.now(), False
        while not over:
            self._serve(method)
            if self.is_over() or self.asked is not None:
                break
            step = self._step(method)
            if step is not None:
                self._note(step, tally, phase, number)
            over = self._look(step, method, drive, (phase, tally, began_s))
        if not over and not (drive is None and self.asked in ENDS_ON_A_FLOOR):
            return None
        if drive is None:
            tally.unfinished += self.asked is Request.FAILED or (phase == Phase.PROVE and tally.human_steps > 0)
        duration_s, steps = self._robot.now() - began_s, self._classroom.method.novice.training_steps
        record = lap_record(tally, phase, number, self._episode.layout, duration_s, self._journal, steps)
        self._journal.write(record)
        if phase == Phase.TRAIN:
            self._classroom.method.reset()  # who learns by laps learns now
            self.board.end_lap(tally, record)
        return record

    def _await_hand(self) -> None:
        """Nothing drives off before a hand was on the controls."""
        self.show(Stage.READY)
        self._say("ready: put your hand on the dead-man; from then on it drives and learns")
        while not self.is_over() and not self.hand.holds:
            self.idle()
        self._was_there = True
        self.began_s = self._robot.now()

    def _begin(self, method: Method, episode: Episode) -> None:
        self.put(episode)
        self._journal.ledger.new_episode()
        method.reset()
        self._loop.arm()

    def _serve(self, method: Method) -> None:
        """Hear what is asked; while it is paused, stand."""
        if self._loop.restarted():
            method.reset()
            self._journal.ledger.new_episode()
            self._say("the robot was started anew; what was learned goes on")
        if self.service is None:
            return
        self.service.serve()
        while self.service.paused and not self.is_over() and self.asked is None:
            self.idle()

    def _step(self, method: Method) -> Step | None:
        step = self._loop.step(method)
        reason = None if step is None else step.applied.reason
        if reason is not self._reason:
            self._say(self._words(step))
            self._reason = reason
        # In a proof on a twin nobody's hand is there to arm it, and nothing is in its way but what it hits.
        stopped = reason in HELD and reason is not Reason.ESTOP
        if stopped and self._arena is not None and self.board.stage is Stage.PROVING:
            self._loop.arm()
        return step

    def _words(self, step: Step | None) -> str:
        if step is None:
            return f"standing still: {self._loop.trouble}"
        return "driving" if step.applied.reason is Reason.OK else self._explain(step.applied)

    def _note(self, step: Step, tally: Tally, phase: Phase, number: int) -> None:
        count(step, tally, phase)
        layout, steps = self._episode.layout, self._classroom.method.novice.training_steps
        self._journal.note(step, phase=phase, lap=number, layout=layout, training_steps=steps)
        if phase == Phase.TRAIN:
            beginning = step.proposal.choice.driver == Driver.NOBODY
            self.show(Stage.DEMONSTRATION if beginning else Stage.TEACHING)
        else:
            self.show(self.board.stage)

    def _look(self, step: Step | None, method: Method, drive: Drive | None, lap: tuple[Phase, Tally, float]) -> bool:
        """Whether the lap is over, after this step; a twin's robot is put back after a crash in training."""
        phase, tally, began_s = lap
        if is_helped(step, phase):
            tally.unfinished += 1
            return True
        state = None if drive is None else self._loop.truth()
        if drive is None or state is None:
            return False
        late = self._robot.now() > began_s + drive.limit_s
        found = fate(state, tally, phase, blind=step is None, late=late)
        if found is Fate.PUT_BACK:
            self._begin(method, after_crash(drive.episode, state, phase))
        return found is Fate.OVER
