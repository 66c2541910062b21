"""A person's session: what its buttons ask at each stage, how laps end, what is told, and all of it on a twin."""

import dataclasses
import time
from types import SimpleNamespace

import pytest
from msgspec import structs

from lira.fusion.control import ControlLoop
from lira.fusion.experts.tasks import TASKS
from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.log.counts import Account, Ledger
from lira.fusion.log.label_log import read_demonstrations
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, ResultRecord, RunWriter, StepRecord
from lira.fusion.methods.base import Alone, Method
from lira.fusion.methods.presets import METHODS
from lira.fusion.teaching.ride import Tally
from lira.fusion.teaching.teacher import SKILLED
from lira.hal.errors import ConfigError
from lira.hal.messages import (
    Applied,
    Call,
    CourseState,
    Decision,
    Driver,
    LabelCounts,
    OperatorRequest,
    Phase,
    Request,
    Source,
    Stage,
)
from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world
from lira.tools.live.before import Before, sum_up
from lira.tools.live.board import Board
from lira.tools.live.classroom import Classroom
from lira.tools.live.exam import Exam
from lira.tools.live.lap import Fate, fate
from lira.tools.live.lap_driver import LapDriver
from lira.tools.live.lessons import Lessons
from lira.tools.live.requests import reply
from lira.tools.live.rules import Rules
from lira.tools.live.session import LiveSession
from lira.tools.live.verdict import has_passed, judged_words, verdict_words
from lira.tools.runs.build import teacher
from lira.tools.runs.course import Course
from lira.tools.runs.plan import Plan
from lira.tools.runs.simulated import simulate

RESULT = ResultRecord(False, 1, 0, 0, 0, 0, 0, 0, 1.0, 1.0)
PASSED = LapRecord(Phase.PROVE, 1, 0, True, True, 80.0, 0, 0, 0.1, 10, 2, 3, 20, 5, 1.0)
TRUTH = CourseState(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.1, 1.0)


def lap(phase, *, passed=True, **words):
    return structs.replace(PASSED, phase=phase, passed=passed, **words)


# What the buttons ask


REPLIES = [
    (Request.FINISH, Stage.TEACHING, Request.FINISH),
    (Request.PROVE, Stage.TEACHING, Request.PROVE),
    (Request.PROVE, Stage.DEMONSTRATION, Request.PROVE),
    (Request.PROVE, Stage.JUDGING, Request.PASSED),
    (Request.PROVE, Stage.VERDICT, Request.FINISH),
    (Request.PASSED, Stage.JUDGING, Request.PASSED),
    (Request.FAILED, Stage.JUDGING, Request.FAILED),
    (Request.RESET, Stage.JUDGING, Request.FAILED),
    (Request.RESET, Stage.TEACHING, Request.RESET),
    (Request.RESUME, Stage.PRACTICE, Request.RESUME),
    (Request.PAUSE, Stage.VERDICT, Request.RESUME),
]
REFUSED = [
    (Request.PROVE, Stage.PRACTICE),
    (Request.PROVE, Stage.PROVING),
    (Request.PASSED, Stage.TEACHING),
    (Request.FAILED, Stage.VERDICT),
    (Request.UNDO, Stage.PROVING),
]


@pytest.mark.parametrize(("request_", "stage", "ends"), REPLIES)
def test_a_button_asks_what_the_stage_makes_of_it(request_, stage, ends):
    replied = reply(request_, stage, trained=True)
    assert (replied.answer[0], replied.ends) == (True, ends)


@pytest.mark.parametrize(("request_", "stage"), REFUSED)
def test_what_makes_no_sense_at_a_stage_is_refused_and_ends_nothing(request_, stage):
    replied = reply(request_, stage, trained=True)
    assert (replied.answer[0], replied.ends) == (False, None)


def test_nothing_is_proven_of_who_has_learned_nothing():
    assert reply(Request.PROVE, Stage.TEACHING, trained=False).ends is None


@pytest.mark.parametrize("request_", [Request.PAUSE, Request.SAVE, Request.HANDOVER])
def test_pause_save_and_handover_stay_those_of_the_service(request_):
    assert reply(request_, Stage.TEACHING, trained=True) is None


# How a lap ends


def on(**words):
    return dataclasses.replace(TRUTH, **words)


FATES = [
    (on(), Phase.TRAIN, {}, Fate.GOES_ON),
    (on(collided=True), Phase.TRAIN, {}, Fate.PUT_BACK),
    (on(lost=True), Phase.TRAIN, {}, Fate.PUT_BACK),
    (on(collided=True), Phase.PROVE, {}, Fate.OVER),
    (on(lost=True), Phase.UNSEEN, {}, Fate.OVER),
    (on(finished=True), Phase.TRAIN, {}, Fate.OVER),
    (on(), Phase.TRAIN, {"late": True}, Fate.GOES_ON),  # a person takes the time it takes
    (on(), Phase.PROVE, {"late": True}, Fate.OVER),
    (on(clearance_m=0.1), Phase.TRAIN, {"blind": True}, Fate.PUT_BACK),
    (on(clearance_m=2.0), Phase.TRAIN, {"blind": True}, Fate.GOES_ON),
]


@pytest.mark.parametrize(("state", "phase", "words", "expected"), FATES)
def test_a_lap_goes_on_is_put_back_or_is_over(state, phase, words, expected):
    tally = Tally()
    assert fate(state, tally, phase, **{"blind": False, "late": False, **words}) is expected
    assert tally.passed == (expected is Fate.GOES_ON or state.finished)


# Which layouts


def test_a_session_teaches_its_own_layout_until_the_novice_was_examined():
    lessons = Lessons(5)
    lessons.note_lap(passed=True)
    assert lessons.layout == 5
    assert list(lessons.draw(3)) == [6, 7, 8]
    assert list(lessons.draw(2)) == [9, 10]  # nobody is examined on the same layout twice


def test_what_the_novice_failed_is_taught_until_it_was_passed_and_then_something_new():
    lessons = Lessons(0)
    failed = [lap(Phase.UNSEEN, layout=number, passed=number not in (2, 4)) for number in lessons.draw(4)]
    lessons.note_proof([lap(Phase.PROVE), *failed])
    assert lessons.layout == 2
    lessons.note_lap(passed=False)
    assert lessons.layout == 2
    lessons.note_lap(passed=True)
    assert (lessons.layout, lessons.taught) == (4, 2)  # a proof begins where it was taught
    lessons.note_lap(passed=True)
    assert lessons.layout == 5
    assert list(lessons.draw(2)) == [6, 7]


def test_who_fails_where_it_was_taught_is_taught_there_again():
    lessons = Lessons(0)
    lessons.note_proof([lap(Phase.PROVE, passed=False)])
    lessons.note_lap(passed=True)
    assert lessons.layout == 0


def test_what_was_seen_on_other_days_is_not_unseen():
    assert list(Lessons(0, {0, 3, 12}).draw(2)) == [13, 14]
    assert list(Lessons(20, {0, 3}).draw(2)) == [21, 22]


def test_time_is_up_for_teaching_and_not_for_a_proof_that_was_begun():
    rules = Rules(minutes=2.0)
    assert [stage for stage in Stage if rules.is_late(stage, 121.0)] == [
        *(Stage.DEMONSTRATION, Stage.TEACHING, Stage.VERDICT, Stage.OVER)
    ]
    assert not any(rules.is_late(stage, 119.0) for stage in Stage)
    assert not any(Rules().is_late(stage, 1e6) for stage in Stage)


# What it comes to


def test_a_verdict_says_how_many_unseen_layouts_and_how_sure_that_is():
    laps = [lap(Phase.PROVE), *[lap(Phase.UNSEEN)] * 11, lap(Phase.UNSEEN, passed=False, collisions=1)]
    assert verdict_words(laps) == "It drove 11 of 12 unseen layouts; 95 %: 62 to 100 % (collisions: 1)"
    assert has_passed(laps)
    assert not has_passed([*laps, lap(Phase.UNSEEN, passed=False)])


def test_who_fails_where_it_was_taught_has_not_passed_and_the_verdict_says_why():
    assert not has_passed([])
    own = [lap(Phase.PROVE, passed=False, lost=1)]
    assert verdict_words(own) == "It did not drive the course it was taught on alone (lost: 1)"
    helped = [lap(Phase.PROVE, passed=False, unassisted=False)]
    assert verdict_words(helped).endswith("(you took over: 1)")
    assert "were not tried" in verdict_words([lap(Phase.PROVE)])
    assert judged_words(2, 3).startswith("It drove 2 of 3 times as you wanted; 95 %")


def test_labels_that_are_taken_back_after_the_verdict_make_it_void():
    board = Board("ada", Before(), Ledger(), lambda: 1.0, lambda _: None, lambda _: None)
    driver = SimpleNamespace(board=board, service=None, asked=None)
    novice = SimpleNamespace(trained=True)
    room = SimpleNamespace(
        undo=lambda _: (True, "not learned any more"), before=Before(), method=SimpleNamespace(novice=novice)
    )
    session = LiveSession(driver, None, room, SimpleNamespace(ledger=Ledger()), Rules(), lambda _: None)
    session._proof, session.converged = [lap(Phase.PROVE)], True
    board.note_verdict("It drove 1 of 1 time as you wanted", converged=True)
    board.show(Stage.VERDICT, 0)
    for _ in range(2):  # it is said once
        assert session.take(OperatorRequest(Request.UNDO)) == (True, "not learned any more")
    assert not session.converged
    since = "since then labels were taken back, and what is left has not been proven"
    assert session.words == f"It drove 1 of 1 time as you wanted; {since}"


def test_the_board_counts_laps_and_tells_a_new_stage_at_once():
    told, said = [], []
    board = Board("ada", Before(), Ledger(), lambda: 1.0, told.append, said.append)
    assert board.begin_lap() == 1
    board.show(Stage.TEACHING, 3)
    board.show(Stage.TEACHING, 3)  # too soon to be told again
    board.end_lap(Tally(steps=10, human_steps=4), lap(Phase.TRAIN, collisions=2))
    board.note_proof([lap(Phase.PROVE), lap(Phase.UNSEEN, passed=False)])
    board.note_verdict("words", converged=True)
    board.show(Stage.VERDICT, 4)
    assert [(state.stage, state.layout) for state in told] == [(Stage.TEACHING, 3), (Stage.VERDICT, 4)]
    last = told[-1]
    assert (last.person, last.laps, last.passed, last.collisions, last.words) == ("ada", 1, 1, 2, "words")
    assert (last.curve, last.proven, last.shown, last.converged) == ((pytest.approx(0.6),), 1, 2, True)
    board.begin_lap()
    assert (board.state.shown, board.state.converged) == (0, False)  # it goes on being taught
    assert "60% driven without you" in said[0]


def decided(number, *, phase=Phase.TRAIN, driver=Driver.NOVICE, layout=0):
    said = (number, driver, Call.NONE, (1.0, 0.0), (1.0, 0.0), None, (), 0.06)
    decision = Decision(1.0, *said, LabelCounts(), 3, 2, 1, phase, number)
    return StepRecord(decision, layout=layout)


def test_the_days_before_are_summed_up_by_lap():
    head = Plan(METHODS["plus"]).head(load_profile("thesis-sim"), "line")
    account = Account(steps=8, human_steps=3)
    records = [
        head,
        *[decided(1), decided(1, driver=Driver.HUMAN)],
        lap(Phase.TRAIN, lap=1, collisions=2, passed=False),
        decided(1, phase=Phase.UNSEEN, layout=7),
        lap(Phase.UNSEEN, lost=1),
        structs.replace(RESULT, account=account),
        head,
        *[decided(2)] * 4,
        lap(Phase.TRAIN, lap=2, lost=1),
        decided(3),  # cut off
    ]
    before = sum_up(records, head)
    assert (before.laps, before.passed, before.collisions, before.lost) == (3, 1, 2, 1)
    assert (before.curve, before.layouts, before.account) == ((0.5, 1.0), {0, 7}, account)
    assert before.newest == decided(3).decision
    assert sum_up([], head) == Before()
    board = Board("ada", before, Ledger(), lambda: 1.0, [].append, [].append)
    assert (board.begin_lap(), board.state.passed, board.state.curve) == (4, 1, (0.5, 1.0))


def test_counts_go_on_from_another_day_and_labels_are_taken_back():
    ledger = Ledger()
    before = LabelCounts(given_human=5, given_expert=9, stored_human=4, stored_expert=7, demonstration=3)
    ledger.go_on(before, interventions=2, calls=6)
    assert (ledger.labels, ledger.interventions, ledger.calls) == (before, 2, 6)
    account = Account(steps=100, human_steps=30, answered=4)
    again = Ledger()
    again.go_on(before, 2, 6, account)
    assert (again.account.steps, again.account.human_steps, again.account.answered) == (100, 30, 4)
    ledger.take_back("human", 5)
    assert (ledger.labels.stored_human, ledger.labels.demonstration) == (0, 2)


# The exam


class Learner(Method):
    """One that drives straight on."""

    def propose(self, features):
        raise AssertionError("it is not taught here")

    def alone(self, phase):
        assert phase is Phase.UNSEEN
        return Alone("novice", lambda _: (1.0, 0.0))


def short(name="line", finish_m=12.0):
    """A world whose laps are short."""
    place = load_world(name)
    limits, line = structs.replace(place.limits, finish_m=finish_m), structs.replace(place.line, closed=False)
    return structs.replace(place, limits=limits, line=line)


def examined(journal, count, *, enough=False):
    profile, place = load_profile("thesis-sim"), short(finish_m=2.0)
    drives = [Course(profile, place).lap(layout) for layout in range(3, 3 + count)]
    with Exam(profile, place, Learner(), drives, journal) as exam:
        while exam.goes_on and not enough:
            time.sleep(0.01)
    return exam.laps


def test_an_exam_shows_every_layout_and_is_written_down_but_not_published():
    written, published = [], []
    journal = Journal(write=written.append, publish=published.append)
    laps = examined(journal, 3)
    assert [(each.phase, each.lap, each.layout) for each in laps] == [(Phase.UNSEEN, k + 1, 3 + k) for k in range(3)]
    assert [record for record in written if isinstance(record, LapRecord)] == list(laps)
    assert sum(isinstance(record, StepRecord) for record in written) > 10
    assert published == []
    assert journal.ledger.account.steps == 0


def test_an_exam_ends_early_if_nobody_waits_for_it():
    assert len(examined(Journal(), 500, enough=True)) < 500


# A whole session, in this process


class Taught(ControlLoop):
    """A loop into which a scripted teacher reaches as a person's hand would."""

    def __init__(self, robot, hand):
        super().__init__(robot, truth=robot.arena.state)
        self.hand = hand

    def step(self, method, teacher=None):
        return super().step(method, self.hand)


class Always:
    """A hand that is there whenever it is looked for."""

    holds = True


class NoService:
    """Nobody asks anything, until `script` says so at a stage."""

    paused = False

    def __init__(self, session, script):
        self.session, self.script, self.answers = session, dict(script), []

    def serve(self):
        request = self.script.pop(self.session.board.stage, None)
        if request is not None:
            self.answers.append(self.session.take(OperatorRequest(request)))

    def change_method(self, method):
        self.session_method = method


LONGEST = 600  # looks


class InTurn(NoService):
    """Asks in turn, each after so many looks at its stage. The hand is off the controls while it is judged."""

    def __init__(self, session, turns, reach):
        super().__init__(session, {})
        self.turns, self.reach, self.hand, self.looks = list(turns), reach, reach.hand, 0

    def serve(self):
        stage = self.session.board.stage
        self.reach.hand = None if stage is Stage.JUDGING else self.hand
        self.looks += bool(self.turns) and stage is self.turns[0][0]
        if self.turns and self.looks > self.turns[0][1]:
            accepted, words = self.session.take(OperatorRequest(self.turns[0][2]))
            self.turns = self.turns[accepted:]  # asked again until it has learned something
            self.looks = 0 if accepted else self.looks
            assert self.looks < LONGEST, words


def hold(folder, *, script, laps=3, world="line", unseen=1, practice_s=0.0, floor=False):
    """A session on a twin in this process; on a `floor` nobody says where the robot is, and `script` are turns."""
    place, profile = short(world), load_profile(TASKS["line"].profile)
    plan = Plan(METHODS["plus"], folder=folder, laps=laps)
    said, told, written = [], [], []
    with simulate(place, profile, renderer="sketch") as robot:
        hand = teacher(SKILLED, profile, place, 0, 0)
        with (
            Classroom(plan, profile, world, InlineTrainer, said.append) as room,
            RunWriter(folder / "run.jsonl") as file,
        ):
            file.write(room.head)
            journal = Journal(keep=room.keep, write=lambda record: (written.append(record), file.write(record)))
            room.before.go_on(journal.ledger)
            course, arena = (None, None) if floor else (Course(profile, place), robot.arena)
            rules = Rules(practice_s, "ada", laps, unseen=unseen)
            board = Board("ada", room.before, journal.ledger, robot.now, told.append, said.append)
            reach = Taught(robot, hand)
            driver = LapDriver(
                *(robot, arena, reach, room, journal, Always(), rules, board, said.append),
                lambda applied: str(applied.reason),
            )
            session = LiveSession(driver, course, room, journal, rules, said.append)
            driver.service = InTurn(session, script, reach) if floor else NoService(session, script)
            session.run()
        hand.close()
    return session, said, told, written


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    folder = tmp_path_factory.mktemp("session")
    script = {Stage.VERDICT: Request.FINISH}
    return folder, *hold(folder, script=script, laps=1, unseen=0, practice_s=1.0)


def test_a_session_goes_from_practice_to_a_verdict(held):
    _, session, said, told, written = held
    stages = list(dict.fromkeys(state.stage for state in told))
    assert stages[:2] == [Stage.PRACTICE, Stage.READY]
    assert stages[-1] is Stage.OVER
    laps = [record for record in written if isinstance(record, LapRecord)]
    assert laps[0].phase is Phase.TRAIN
    assert said[0].startswith("practice")
    assert session.board.state.laps == len([each for each in laps if each.phase == Phase.TRAIN])
    assert all(record.state is not None for record in written if hasattr(record, "decision"))  # the truth is in it


def test_on_a_floor_the_person_judges(tmp_path):
    turns = [
        (Stage.TEACHING, 60, Request.PROVE),
        (Stage.JUDGING, 10, Request.FAILED),
        (Stage.TEACHING, 30, Request.PROVE),
        (Stage.JUDGING, 10, Request.PASSED),
        (Stage.TEACHING, 5, Request.FINISH),  # a hand on the controls has gone on meanwhile
    ]
    session, _, told, written = hold(tmp_path, script=turns, floor=True)
    judged = [record for record in written if isinstance(record, LapRecord) and record.phase is Phase.PROVE]
    assert [each.passed for each in judged] == [False, True]
    assert session.converged
    verdicts = [(state.words, state.converged) for state in told if state.stage is Stage.VERDICT]
    assert verdicts[0][0].startswith("It drove 0 of 1 time as you wanted")
    assert [converged for _, converged in dict.fromkeys(verdicts)] == [False, True]


def test_it_goes_on_another_day_with_counts_that_go_on(held):
    folder, session, *_ = held
    plan = Plan(METHODS["plus"], folder=folder)
    with Classroom(plan, load_profile("thesis-sim"), "line", InlineTrainer, print) as room:
        ledger = Ledger()
        room.before.go_on(ledger)
        before = session.result()
        assert ledger.labels.stored_human == before.human_labels
        assert ledger.interventions == before.interventions
        assert room.method.novice.stored == sum(label.stored for label in read_demonstrations(folder / "labels.lira"))


def test_another_method_does_not_go_on_in_its_folder(held):
    plan = Plan(METHODS["hold"], folder=held[0])
    with pytest.raises(ConfigError, match="was taught by 'plus'"):
        Classroom(plan, load_profile("thesis-sim"), "line", InlineTrainer, print)


def test_the_last_interventions_labels_are_taken_back_and_unlearned(held):
    folder, *_ = held
    plan = Plan(METHODS["plus"], folder=folder)
    first = next(read_demonstrations(folder / "labels.lira"))
    with Classroom(plan, load_profile("thesis-sim"), "line", InlineTrainer, print) as room:
        for number in range(3):
            stamp_s = 1000.0 + 0.2 * number
            room.keep(
                dataclasses.replace(first, source="human", stored=True, stamp_s=stamp_s, observation=9000 + number)
            )
    with Classroom(plan, load_profile("thesis-sim"), "line", InlineTrainer, print) as room:
        ledger, stored = Ledger(), room.method.novice.stored
        ledger.go_on(LabelCounts(stored_human=5), 0, 0)
        assert room.undo(ledger) == (True, "not learned any more: 3 labels of the last intervention")
        assert room.method.novice.stored == stored - 3
        assert ledger.labels.stored_human == 2


def test_applied_by_a_hand_is_a_hand():
    from lira.tools.live.hand import is_by_hand

    assert is_by_hand(Applied(None, 0.0, Source.TELEOP), 0.1)
    assert not is_by_hand(Applied(None, 0.0, Source.TELEOP), 1.0)
    assert not is_by_hand(Applied(None, 0.0, Source.POLICY), 0.1)


class Planner:
    """A teacher that always drives ahead."""

    def __init__(self):
        self.layouts = []

    def reset(self, layout):
        self.layouts.append(layout)

    def act(self, state, proposal, policy):
        return 1.0, 0.0


@pytest.mark.parametrize(
    ("stage", "state", "action"),
    [
        (Stage.PRACTICE, TRUTH, (1.0, 0.0)),
        (Stage.READY, TRUTH, (1.0, 0.0)),
        (Stage.TEACHING, on(lost=True), None),
        (Stage.PROVING, TRUTH, None),
        (Stage.VERDICT, on(lost=True), (0.0, 0.0)),
        (Stage.OVER, TRUTH, None),
    ],
)
def test_a_scripted_person_has_its_hands_where_the_session_wants_them(stage, state, action):
    from lira.hal.messages import SessionState
    from lira.tools.live.scripted_person import Person

    planner = Planner()
    assert Person(planner, ()).act(state, None, SessionState(1.0, stage, layout=7)) == action
    assert planner.layouts == [7]
