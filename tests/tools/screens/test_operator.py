"""One voice: every situation in one table, what comes before what, and that there are words for all of them."""

import string
from dataclasses import replace

import pytest
from wiring import real_time_null, remote, served, wait_for

from lira.hal.errors import ConfigError
from lira.hal.messages import (
    STOP,
    Applied,
    BatteryState,
    Command,
    CourseState,
    Decision,
    ExpertView,
    LabelCounts,
    OperatorAnswer,
    Reason,
    Request,
    SessionState,
    Source,
    Stage,
    Twist,
)
from lira.tools.joystick.deadman import State
from lira.tools.operator.listen import explaining
from lira.tools.operator.situation import HAND_DRIVES, STANDING, URGENCY, Situation, Urgency, situation_of
from lira.tools.operator.view import View, battery_share
from lira.tools.operator.voice import explain, languages, speak, verdict, vocabulary

EXPERTS = (ExpertView("camera", (1.0, 0.5), 0.16, True), ExpertView("lidar", (0.7, -0.6), 0.01, False))
DECIDED = Decision(
    1.0, 3, "camera", "attention", (0.8, 0.5), (0.1, 0.0), None, EXPERTS, 0.06, LabelCounts(1, 2, 3, 4, 5), 2, 3, 4
)
BY_POLICY = Applied(Twist(0.4, 0.2), 1.0, Source.POLICY, Reason.OK)
BY_HAND = replace(BY_POLICY, source=Source.TELEOP)
VIEW = View("rosbot", applied=BY_POLICY, link_age_s=0.02, decision=DECIDED, decision_age_s=0.1)
PAUSED = replace(VIEW, answer=OperatorAnswer(1.0, paused=True, count=2, words="paused"), answer_age_s=0.1)
TRUTH = CourseState(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.1, 1.0)


def decided(**words):
    return replace(VIEW, decision=replace(DECIDED, **words))


def held(reason, clamps=(), **words):
    return replace(VIEW, applied=Applied(STOP, 1.0, Source.NONE, reason, clamps), **words)


def on_course(**words):
    return replace(VIEW, truth=replace(TRUTH, **words), truth_age_s=0.05)


def in_session(stage, view=VIEW, *, converged=False, **words):
    state = SessionState(1.0, Stage(stage), "ada", words="It drove 2 of 3", converged=converged)
    return replace(view, session=state, session_age_s=0.1, **words)


NEW = {"training_steps": 0, "labels": LabelCounts()}
CASES = [
    (replace(VIEW, estop=True), "estop"),
    (replace(VIEW, estop=True, confirmed=True), "estop_confirmed"),
    (replace(VIEW, estop=True, link_age_s=9.0), "estop"),
    (View("rosbot"), "no_link"),
    (replace(VIEW, link_age_s=3.0), "no_link"),
    (View("rosbot", lockstep=True), "lockstep"),
    (replace(VIEW, lockstep=True, link_age_s=3.0), "lockstep"),
    (replace(VIEW, lockstep=True), "one_expert"),
    (replace(VIEW, other=True), "other"),
    (replace(VIEW, applied=BY_HAND), "person"),
    (replace(decided(human=(0.5, 0.0)), applied=BY_HAND), "person_slow"),
    (replace(decided(human=(1.0, 0.0)), applied=BY_HAND), "person"),
    (replace(decided(human=(-0.5, 0.0)), applied=BY_HAND), "person"),
    (replace(PAUSED, applied=BY_HAND), "person_paused"),
    (PAUSED, "paused"),
    (replace(PAUSED, answer_age_s=9.0), "one_expert"),
    (in_session("practice"), "practice"),
    (in_session("practice", applied=BY_HAND), "practice"),
    (in_session("ready"), "ready"),
    (in_session("proving"), "proving"),
    (in_session("exam"), "exam"),
    (in_session("judging"), "judging"),
    (in_session("judging", held(Reason.STALE)), "stale"),
    (in_session("verdict"), "verdict"),
    (in_session("verdict", converged=True), "passed"),
    (replace(in_session("verdict"), session_age_s=9.0), "one_expert"),
    (in_session("teaching"), "one_expert"),
    (in_session("teaching", applied=BY_HAND), "person"),
    (in_session("teaching", on_course(collided=True)), "one_expert"),
    (in_session("verdict", PAUSED), "paused"),
    (on_course(collided=True), "collided"),
    (on_course(lost=True), "strayed"),
    (on_course(finished=True), "finished"),
    (replace(on_course(collided=True), applied=BY_HAND), "person"),
    (replace(on_course(collided=True), truth_age_s=5.0), "one_expert"),
    (held(Reason.NO_COMMAND), "no_command"),
    (held(Reason.STALE), "stale"),
    (held(Reason.STALE, decision=None), "no_command"),
    (held(Reason.STALE, ("no_lidar",)), "device_lost"),
    (held(Reason.NEUTRAL_FIRST), "neutral_first"),
    (held(Reason.NEUTRAL_FIRST, hand=State.DRIVING), "neutral_held"),
    (held(Reason.REFUSED), "refused"),
    (held(Reason.OBSTACLE), "obstacle"),
    (held(Reason.OK), "told_to_stand"),
    (replace(VIEW, applied=replace(BY_POLICY, reason=Reason.OBSTACLE)), "obstacle"),
    (decided(driver="none", call="feedback", **NEW), "waits"),
    (decided(driver="none", call="feedback"), "unknown"),
    (decided(driver="novice", call="feedback"), "disagree"),
    (decided(driver="shield", call="none"), "shield"),
    (decided(driver="shield", call="feedback"), "shield_stands"),
    (decided(driver="novice", call="none"), "novice"),
    (decided(driver="novice", call="none", phase="prove"), "proving"),
    (decided(driver="novice", call="none", phase="unseen"), "proving"),
    (decided(driver="mean", call="none"), "mean"),
    (decided(), "one_expert"),
    (decided(call="none"), "expert"),
    (replace(VIEW, decision=None), "policy"),
    (replace(VIEW, decision_age_s=2.0), "policy"),
]


@pytest.mark.parametrize(("view", "situation"), CASES, ids=[f"{k}-{name}" for k, (_, name) in enumerate(CASES)])
def test_every_situation_is_told_from_the_others(view, situation):
    assert situation_of(view) is Situation(situation)


def test_no_situation_is_left_out_of_the_cases_above():
    assert {name for _, name in CASES} == set(Situation)


def test_every_reason_of_the_governor_has_a_situation():
    assert set(STANDING) == set(Reason)
    assert HAND_DRIVES == State.DRIVING


@pytest.mark.parametrize("language", languages())
def test_every_language_has_words_for_every_situation(language):
    words = vocabulary(language)
    assert set(words) == set(Situation)
    known = {"expert", "age", "lost", "verdict", "proven", "shown"}
    for said in words.values():
        for line in (said.who, said.why, said.now):
            assert line
            assert {name for _, name, _, _ in string.Formatter().parse(line) if name} <= known


def test_a_language_that_is_not_there_is_an_error_with_those_that_are():
    with pytest.raises(ConfigError, match=r"Choose one of: .*en"):
        speak(VIEW, "xx")


def test_what_needs_a_person_says_what_to_do_with_a_hand():
    for situation, said in vocabulary("en").items():
        if URGENCY[situation] is Urgency.NEED:
            assert any(what in said.now for what in ("dead-man", "Hold", "sticks")), situation


def test_words_name_the_expert_the_devices_and_who_commands():
    assert speak(VIEW).who == "EXPERT CAMERA"
    assert "lidar" in speak(held(Reason.STALE, ("no_lidar",), decision=None)).why
    assert " for 3 s" in speak(replace(VIEW, link_age_s=3.0)).why
    assert speak(replace(VIEW, applied=replace(BY_HAND, commander="anna"))).why.startswith("anna: ")


@pytest.mark.parametrize("reason", Reason)
def test_a_terminal_is_told_why_the_robot_stands_and_what_to_do(reason):
    line = explain(Applied(STOP, 1.0, Source.NONE, reason))
    assert "\n" not in line
    assert len(line) > 30


def test_a_terminal_whose_commands_are_refused_beside_another_driver_hears_who_drives_and_not_that_the_robot_stands():
    refused = Applied(STOP, 1.0, reason=Reason.REFUSED)
    line = explain(refused, replace(BY_POLICY, commander="anna"))
    assert line.startswith("SOMEBODY ELSE DRIVES: anna: The robot does as another driver says")
    assert "STANDS" not in line
    for stands in (None, refused, replace(BY_POLICY, reason=Reason.STALE)):
        line = explain(refused, stands)
        assert "STANDS" in line
        assert "or somebody else commands" in line


def test_a_second_driver_is_told_that_another_drives():
    with served(real_time_null()) as robot, remote(robot) as first, remote(robot) as second:
        explained = explaining(second.bus)

        def drives(driver, twist=BY_POLICY.twist):
            return driver.drive(Command(twist, driver.now(), Source.POLICY, answers=1))

        def is_told():
            return drives(first).reason is Reason.OK and explained(drives(second)).startswith("SOMEBODY ELSE")

        drives(first, STOP)
        wait_for(is_told)


def test_what_became_of_a_request_is_told_while_it_is_news():
    fresh = replace(PAUSED, verdict_age_s=0.1)
    refused = replace(fresh, answer=replace(fresh.answer, accepted=False))
    assert (verdict(fresh), verdict(refused)) == (("paused", True), ("paused", False))
    assert verdict(replace(fresh, verdict_age_s=60.0)) == ("", None)
    assert verdict(replace(fresh, unanswered=Request.SAVE))[1] is False
    assert verdict(VIEW) == ("nobody takes requests: start lira fusion", None)
    assert verdict(replace(VIEW, link_age_s=9.0)) == ("", None)


def test_the_battery_is_between_empty_and_full():
    assert [battery_share(BatteryState(0.0, volts)) for volts in (5.0, 11.4, 13.0)] == pytest.approx([0.0, 0.5, 1.0])
