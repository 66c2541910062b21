from dataclasses import replace

import numpy as np
import pytest

from lira.fusion.control import Step
from lira.fusion.log.recorder import Journal
from lira.fusion.methods.base import Choice, Lesson, Proposal
from lira.fusion.preprocess import Features
from lira.hal.messages import STOP, Applied, Call, CourseState, ExpertView, LabelCounts, Observation

IMAGE = (np.arange(32 * 32).reshape(32, 32) % 256 / 255).astype(np.float32)
FEATURES = Features(scan=np.linspace(0, 1, 101, dtype=np.float32), image=IMAGE)
STATE = CourseState(2.0, 1.0, 0.5, 0.1, 0.9, 0.2, 1.1, float("nan"), clearance_m=float("inf"))
VIEWS = (ExpertView("camera", (1.0, 0.1), 0.3, True), ExpertView("lidar", (1.0, 0.0), 0.0, False))


def step(driver="novice", *, proposed=None, label=None, stored=False, call=Call.NONE, state=STATE):
    action = label or (0.8, 0.1)
    wish = Choice(proposed or driver, action, call=call)
    proposal = Proposal(FEATURES, wish, novice=(0.7, 0.0), experts=VIEWS, threshold=0.06)
    lesson = Lesson(Choice(driver, action, label=label, call=call), stored)
    return Step(Observation(17, 2.0), proposal, Applied(STOP, 2.0), lesson, state)


class Desk:
    """Where a journal writes to, in order of arrival."""

    def __init__(self):
        self.came = []
        self.journal = Journal(
            keep=lambda label: self.came.append(("label", label)),
            write=lambda record: self.came.append(("record", record)),
            publish=lambda decision: self.came.append(("decision", decision)),
        )

    def note(self, noted, *, phase="train", lap=2, training_steps=1):
        del self.came[:]
        self.journal.note(noted, phase=phase, lap=lap, layout=5, training_steps=training_steps)
        return dict(self.came)


@pytest.fixture
def desk():
    return Desk()


def test_the_label_is_kept_before_anything_else_can_fail(desk):
    desk.note(step("human", label=(0.2, 1.0), stored=True))
    assert [kind for kind, _ in desk.came] == ["label", "decision", "record"]


def test_a_label_goes_to_the_log_with_what_was_seen_whether_stored_or_not(desk):
    for stored in (True, False):
        label = desk.note(step("camera", label=(1.0, 0.1), stored=stored))["label"]
        assert (label.stamp_s, label.observation, label.lap, label.source) == (2.0, 17, 2, "camera")
        assert (label.action, label.novice, label.stored) == ((1.0, 0.1), (0.7, 0.0), stored)
        assert label.features is FEATURES


def test_a_step_without_a_label_keeps_none(desk):
    assert "label" not in desk.note(step())


def test_the_decision_says_who_drives_and_why(desk):
    taken = step("human", proposed="novice", label=(0.2, 1.0), stored=True, call=Call.FEEDBACK)
    decision = desk.note(taken)["decision"]
    assert (decision.stamp_s, decision.observation, decision.phase, decision.lap) == (2.0, 17, "train", 2)
    assert (decision.driver, decision.call, decision.threshold) == ("human", "feedback", 0.06)
    assert decision.executed == decision.human == (0.2, 1.0)
    assert decision.novice == (0.7, 0.0)
    assert decision.experts == VIEWS
    assert decision.labels == LabelCounts(given_human=1, stored_human=1)
    assert decision.interventions == decision.calls == 1
    assert desk.note(step())["decision"].human is None


def test_nothing_is_counted_while_the_novice_drives_alone(desk):
    for phase in ("prove", "unseen"):
        decision = desk.note(step("novice", call=Call.ATTENTION), phase=phase)["decision"]
        assert (decision.calls, decision.phase) == (0, phase)


def test_the_record_names_what_was_stored_and_knows_no_nan(desk):
    record = desk.note(step("camera", label=(1.0, 0.1), stored=True))["record"]
    assert (record.label, record.layout) == ("camera", 5)
    assert (record.state.x_m, record.state.lateral_m, record.state.clearance_m) == (1.0, None, None)
    assert desk.note(step("camera", label=(1.0, 0.1), stored=False))["record"].label is None
    assert desk.note(step(state=None))["record"].state is None


def test_a_picture_is_kept_when_a_call_rises_and_only_then(desk):
    calls = [Call.NONE, Call.ATTENTION, Call.ATTENTION, Call.FEEDBACK, Call.NONE, Call.FEEDBACK]
    pictures = [desk.note(step(call=call))["record"].image for call in calls]
    assert [picture is not None for picture in pictures] == [False, True, False, True, False, True]
    assert pictures[1] == np.rint(IMAGE * 255).astype(np.uint8).tobytes()


def test_time_passes(desk):
    first, second = (desk.note(replace(step()))["record"].elapsed_s for _ in range(2))
    assert 0.0 <= first <= second
