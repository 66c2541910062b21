"""Appendix D: who goes on driving after a take-over, for how long, and what ends it."""

import itertools

import pytest
from taught import FEATURES, make_novice, play

from lira.fusion.methods.lira import PRESETS, LiraSpf
from lira.fusion.methods.shared_feedback import SharedFeedback, SharingSettings, similar_expert
from lira.hal.messages import Call

CAMERA, LIDAR, NOVICE = (1.0, 0.5), (1.0, -0.5), (0.9, 0.0)
LIKE_LIDAR, UNLIKE = (1.0, -0.4), (0.0, -0.1)
LIMIT = 0.2**2


def example(human):
    return human, [CAMERA, LIDAR], NOVICE


def test_the_nearest_by_mean_squared_error_is_worked_out_over_the_whole_take_over():
    # errors of the lidar expert: (0 + 0.01) / 2 and (0 + 0.04) / 2, in the mean 0.0125
    r = [example((1.0, -0.4)), example((1.0, -0.3))]
    assert similar_expert(r, 0.0126) == 1
    assert similar_expert(r, 0.0125 - 1e-6) is None


def test_an_expert_that_is_no_nearer_than_the_novice_gets_nothing():
    assert similar_expert([example((0.9, 0.0))], 1.0) is None
    assert similar_expert([example((0.95, 0.05))], 1.0) is None


def make(when, steps=3):
    experts = [play("camera", itertools.repeat(CAMERA)), play("lidar", itertools.repeat(LIDAR))]
    novice, trainer = make_novice(NOVICE)
    method = SharedFeedback(LiraSpf(experts, novice, PRESETS["thesis"], 0.2), SharingSettings(when=when, steps=steps))
    return method, trainer


def drive(method, humans):
    """Feed what the human does, step by step; return who drove and what was asked for."""
    rows = []
    for human in humans:
        proposal = method.propose(FEATURES)
        lesson = method.learn(proposal, human)
        rows.append((lesson.choice.driver, lesson.choice.label, proposal.relieves))
    return rows


def test_flexible_reads_the_intention_when_the_human_lets_go():
    method, trainer = make("flexible")
    rows = drive(method, [LIKE_LIDAR] * 3 + [None] * 6)
    assert [driver for driver, _, _ in rows] == ["human"] * 3 + ["novice"] + ["lidar"] * 3 + ["novice"] * 2
    assert [label for _, label, _ in rows[4:7]] == [LIDAR] * 3
    assert not any(relieves for _, _, relieves in rows)
    assert [label.source for label in trainer.labels] == ["human"] * 3 + ["lidar"] * 3


def test_fixed_asks_for_the_wheel_after_two_human_steps_and_never_takes_it():
    method, _ = make("fixed")
    rows = drive(method, [LIKE_LIDAR] * 4 + [None] * 4)
    assert [relieves for _, _, relieves in rows] == [False, False, True, True, True, False, False, False]
    assert [driver for driver, _, _ in rows] == ["human"] * 4 + ["lidar"] * 3 + ["novice"]


def test_fixed_asks_for_nothing_when_nobody_is_like_the_human():
    method, _ = make("fixed")
    rows = drive(method, [UNLIKE] * 3 + [None] * 2)
    assert [driver for driver, _, _ in rows] == ["human"] * 3 + ["novice"] * 2
    assert not any(relieves for _, _, relieves in rows)


@pytest.mark.parametrize("when", ["fixed", "flexible"])
def test_a_press_and_a_reset_cancel_the_priority(when):
    method, _ = make(when)
    drive(method, [LIKE_LIDAR] * 2 + [None] * 2)
    assert method.propose(FEATURES).choice.driver == "lidar"
    rows = drive(method, [UNLIKE, None, None, None])
    assert [driver for driver, _, _ in rows] == ["human"] + ["novice"] * 3
    drive(method, [LIKE_LIDAR] * 2 + [None] * 2)
    method.reset()
    assert method.propose(FEATURES).choice.driver == "novice"


def test_the_expert_that_drives_calls_for_attention_at_full_speed():
    method, _ = make("flexible")
    drive(method, [LIKE_LIDAR] * 2 + [None])
    proposal = method.propose(FEATURES)
    assert (proposal.choice.call, proposal.command) == (Call.ATTENTION, LIDAR)


def test_the_initial_demonstration_answers_nothing():
    method, _ = make("flexible")
    method.novice.training_steps = 0
    drive(method, [LIKE_LIDAR] * 3)
    method.novice.training_steps = 1
    rows = drive(method, [None] * 3)
    assert [driver for driver, _, _ in rows] == ["novice"] * 3
