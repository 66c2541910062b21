"""What the ledger counts beside labels: a script of steps, counted by hand."""

from dataclasses import replace

import pytest

from lira.fusion.log.counts import Account, Ledger
from lira.fusion.methods.base import Choice, Lesson, Proposal, Settled
from lira.hal.messages import Call

PERIOD_S = 0.2
SCRIPT = {
    ".": Lesson(Choice("novice", (1.0, 0.0))),
    "a": Lesson(Choice("camera", (1.0, 0.2), label=(1.0, 0.2), call=Call.ATTENTION), stored=True),
    "f": Lesson(Choice("novice", (1.0, 0.0), call=Call.FEEDBACK)),
    "h": Lesson(Choice("human", (1.0, 1.0), label=(1.0, 1.0)), stored=True),
    "i": Lesson(Choice("human", (1.0, 1.0), label=(1.0, 1.0))),  # redundant
}


def after(script, *, demonstrating=False):
    ledger = Ledger()
    for k, step in enumerate(script):
        if step == "|":
            ledger.new_episode()
        else:
            ledger.note(SCRIPT[step], now_s=k * PERIOD_S, demonstrating=demonstrating)
    return ledger


def test_steps_are_counted_by_what_happened_in_them():
    account = after("..aaffhhi..").account
    assert account == Account(
        steps=11, human_steps=3, call_steps=4, slowed_steps=2, switches=4, call_episodes=1, answered=1, called_for=1,
        given={"camera": 2, "human": 3}, stored={"camera": 2, "human": 2},
    )  # fmt: skip


def test_the_demonstration_is_only_counted_as_labels():
    account = after("hhi", demonstrating=True).account
    assert account == Account(given={"demonstration": 3}, stored={"demonstration": 2})


@pytest.mark.parametrize(
    ("script", "episodes", "answered", "called_for", "interventions"),
    [
        ("ffhh", 1, 1, 1, 1),  # while it lasts
        ("ff" + 9 * "." + "hh", 1, 1, 1, 1),  # 2.0 s after its last step
        ("ff" + 10 * "." + "hh", 1, 0, 0, 1),  # later
        ("f.f.hh", 2, 2, 1, 1),  # two calls, one answer
        ("ffhhf....", 2, 1, 1, 1),  # the second is not answered again
        ("f|hh", 1, 0, 0, 1),  # put down anew in between
        ("..hh..hh", 0, 0, 0, 2),  # the teacher alone
        ("af.h", 1, 1, 1, 1),  # attention turns into feedback: one episode
    ],
)
def test_calls_are_matched_with_the_interventions_that_follow(script, episodes, answered, called_for, interventions):
    ledger = after(script)
    account = ledger.account
    assert (account.call_episodes, account.answered, account.called_for) == (episodes, answered, called_for)
    assert ledger.interventions == interventions


def test_a_call_counts_by_its_kind_and_an_episode_does_not():
    ledger = after("aff..f")
    assert ledger.calls == 3
    assert ledger.account.call_episodes == 2


def test_a_switch_is_a_change_of_the_driver_within_one_episode():
    assert after("..a.h").account.switches == 3
    assert after("..|a").account.switches == 0


def test_to_give_the_wheel_is_one_intervention_and_one_label_however_long_the_expert_keeps_it():
    ledger = Ledger()
    first = Lesson(Choice("lidar", (1.0, 0.3), label=(1.0, 0.3), given=1), reserved=True)
    second = Lesson(replace(first.choice, driver="camera", given=2), reserved=True)
    for k, step in enumerate([SCRIPT["f"], first, first, SCRIPT["."], second, second]):
        ledger.note(step, now_s=k * PERIOD_S, demonstrating=False)
    assert ledger.interventions == 2
    assert (ledger.labels.given_human, ledger.labels.stored_human) == (2, 2)
    assert ledger.buffer == 0  # nothing is settled yet
    assert ledger.account.answered == 1


def test_a_reserved_label_is_stored_when_it_is_settled():
    ledger = Ledger()
    choice = SCRIPT["a"].choice
    reserved = Lesson(choice, reserved=True)
    settled = tuple(Settled(Proposal(None, choice), stored=stored) for stored in (True, False))
    for k, step in enumerate([reserved, reserved, Lesson(SCRIPT["."].choice, settled=settled)]):
        ledger.note(step, now_s=k * PERIOD_S, demonstrating=False)
    assert (ledger.account.given, ledger.account.stored) == ({"camera": 2}, {"camera": 1})
