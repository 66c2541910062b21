"""Steps of a recording: what was sensed when it was decided, what the wheels got, where a lap ends, what is learned."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from heard import DRIVERS, HEIGHT, LENGTHS, PROFILE, WIDTH, Message, decision, label, level, pictures, recording, stamp

from lira.hal.bus.topics import APPLIED, CAMERA, DECISION, METHOD, SCAN
from lira.hal.messages import CallName, CompressedImage, MethodCall, MethodCalls
from lira.tools.export.buffer import in_buffer
from lira.tools.export.columns import SCAN as SCAN_COLUMN
from lira.tools.export.columns import tables_of
from lira.tools.export.pictures import color_pictures
from lira.tools.export.steps import episodes_of, steps_of


def steps(messages=None):
    return list(steps_of(recording() if messages is None else messages))


def tables(messages=None):
    return tables_of(list(episodes_of(steps(messages))), PROFILE)


def test_a_step_has_what_was_measured_when_it_was_decided():
    for number, step in enumerate(steps()):
        assert step.scan.stamp_s == stamp(number)
        assert step.picture == number
        assert step.odom.linear_m_s == pytest.approx(0.1 * number)  # not the one after


def test_what_came_before_the_decision_was_told_but_after_it_was_made_is_of_the_next():
    late = [each for each in recording() if each.key != DECISION.key]
    late.append(Message(DECISION.key, decision(2, 1, "human")))
    (step,) = steps(late)
    assert step.scan.stamp_s == stamp(2)


def test_the_last_that_the_wheels_got_before_the_next_decision_counts():
    for number, step in enumerate(steps()):
        assert step.applied.twist.angular_rad_s == pytest.approx(0.05 * number)
    assert steps([each for each in recording() if each.key != APPLIED.key])[0].applied is None


def test_a_stale_sensor_is_none():
    assert steps([each for each in recording() if each.key != SCAN.key])[3].scan is None


def test_laps_are_episodes():
    episodes = list(episodes_of(steps()))
    assert [len(each.steps) for each in episodes] == list(LENGTHS)
    assert [each.phase for each in episodes] == ["train", "prove"]


def test_a_robot_that_is_put_down_begins_an_episode_though_phase_and_lap_are_the_same():
    told = []
    for each in recording():
        if each.key == DECISION.key and each.message.stamp_s == stamp(4):
            told.append(Message(METHOD.key, MethodCalls(stamp(4), (MethodCall(CallName.RESET),))))
        told.append(each)
    first, *rest = LENGTHS
    assert [len(each.steps) for each in episodes_of(steps(told))] == [4, first - 4, *rest]


@pytest.mark.parametrize("shift_s", [3.0, -50.0])
def test_a_silence_or_a_clock_that_runs_back_ends_an_episode(shift_s):
    found = steps()[:5]
    moved = [
        replace(step, decision=replace(step.decision, stamp_s=step.decision.stamp_s + shift_s)) for step in found[2:]
    ]
    assert [len(each.steps) for each in episodes_of(found[:2] + moved)] == [2, 3]


def test_without_a_log_the_counts_tell_what_is_learned():
    assert [step.in_buffer for step in steps()][:5] == [False, True, False, False, False]


def test_the_log_of_labels_knows_better():
    labels = [label(0, "human", stored=True), label(1, "human", stored=False), label(2, "camera", stored=True)]
    labels.append(label(3, "human", stored=True))  # the novice drove then
    assert [step.in_buffer for step in in_buffer(steps(), labels)][:5] == [True, False, True, False, False]


def test_columns_say_who_drove_and_what_everybody_proposed():
    first, second = tables()
    assert first["source"].values.tolist() == list(DRIVERS)
    assert first["intervention"].values.tolist() == [True, True, False, False, False]
    assert not second["intervention"].values.any()
    assert first["policy_version"].values.tolist() == [10] * 5
    assert first["action"].values[4] == pytest.approx((0.9, 0.04))
    assert first["experts.camera.action"].values[4] == pytest.approx((1.0, 0.4))
    assert first["experts.camera.active"].values.tolist() == [False, False, True, False, False]
    assert first["experts.lab_wall:go.activation"].values == pytest.approx([0.01] * 5)
    assert first["call"].values.tolist() == ["none", "none", "attention", "none", "none"]
    assert first["applied"].values[4] == pytest.approx((0.1, 0.2))
    assert [column.name for column in first.columns] == [column.name for column in second.columns]


def test_the_scan_is_as_networks_see_it():
    nearest = tables()[0][SCAN_COLUMN].values.min(axis=1)
    assert nearest == pytest.approx([(0.5 + 0.1 * n) / PROFILE.features.max_range_m for n in range(5)], abs=1e-5)


def test_an_expert_that_was_not_there_is_nan():
    messages = list(recording())
    last = max(index for index, each in enumerate(messages) if each.key == DECISION.key)
    messages[last] = Message(DECISION.key, replace(messages[last].message, experts=()))
    column = tables(messages)[1]["experts.camera.action"].values
    assert np.isnan(column[-1]).all()
    assert not np.isnan(column[:-1]).any()


def test_what_is_missing_stands_in_and_is_marked():
    gone = {stamp(2), stamp(3)}
    messages = [each for each in recording() if each.key != CAMERA.key or each.message.stamp_s not in gone]
    table = tables(messages)[0]
    # A picture counts for 0.3 s, so that of the step before is as good.
    assert table["complete"].values.tolist() == [True, True, True, False, True]
    shown = list(pictures(messages).of(table.episode.steps))
    assert [int(each[0, -1, 0]) for each in shown] == [level(n) for n in (0, 1, 1, 1, 4)]


def test_pictures_that_do_not_decode_are_no_fault():
    broken = CompressedImage(stamp(0), b"\x89PNG nothing of it", "png")
    messages = [
        Message(CAMERA.key, broken) if each.key == CAMERA.key and each.message.stamp_s == stamp(0) else each
        for each in recording()
    ]
    found = pictures(messages)
    assert found.size == (HEIGHT, WIDTH)
    steps_ = tables(messages)[0].episode.steps
    assert [int(each[0, -1, 0]) for each in found.of(steps_)][:2] == [128, level(1)]
    assert pictures([]).size is None


def test_pictures_of_another_size_are_resized():
    small = cv2.imencode(".png", np.full((24, 32, 3), 77, np.uint8))[1].tobytes()
    found = [each.message for each in recording() if each.key == CAMERA.key]
    found[1] = CompressedImage(stamp(1), small, "png")
    shown = list(color_pictures(lambda: iter(found)).of(steps()[:2]))
    assert shown[1].shape == (HEIGHT, WIDTH, 3)
    assert int(shown[1][0, 0, 0]) == 77


def test_pictures_that_no_step_shows_are_passed_over():
    found = [each.message for each in recording() if each.key == CAMERA.key]
    shown = list(color_pictures(lambda: iter(found)).of(steps()[3::3]))
    assert [int(each[0, -1, 0]) for each in shown] == [level(3), level(6)]
