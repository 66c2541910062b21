"""Which line of Algorithm 1 decided: over the table of `fusion.methods.lira.choose`, and what `plus` adds."""

from dataclasses import replace

import pytest

from lira.fusion.log.method_trace import Decided, State
from lira.fusion.methods.base import Choice
from lira.fusion.methods.lira import choose
from lira.fusion.methods.presets import method_named
from lira.hal.messages import Call, Driver, ExpertView, Phase
from lira.tools.inquiry.algorithm import activity, line_of, settings_of
from lira.tools.inquiry.trace import Step
from lira.tools.runs.plan import Recipe

HOLD, PLUS = (Recipe(method_named(name), 0, "line") for name in ("hold", "plus"))
TAUGHT = State(100, 100)
NOVICE = (0.9, 0.1)


def expert(name, turn, *, active):
    return ExpertView(name, (1.0, turn), 0.07 if active else 0.01, active)


def step(experts, human=None, phase=Phase.TRAIN, choice=None, **about):
    proposed = choose(None, experts, NOVICE, 0.2) if choice is None else choice
    return Step(1.0, phase, decided=Decided(proposed, NOVICE, experts, 0.06, 1.0, False), human=human, **about)


QUIET = (expert("camera", 0.0, active=False), expert("lidar", 0.0, active=False))
ALONE = (expert("camera", 0.5, active=True), expert("lidar", 0.0, active=False))
AGREE = (expert("camera", 0.5, active=True), expert("lidar", 0.4, active=True))
APART = (expert("camera", 0.5, active=True), expert("lidar", -0.5, active=True))


@pytest.mark.parametrize(
    ("experts", "human", "lines", "words"),
    [
        (APART, (1.0, 0.0), "7 to 9", "the human gives feedback"),
        (ALONE, None, "10 to 13", "only camera is active"),
        (AGREE, None, "14 to 18", "camera and lidar agree (turn by 0.10, T is 0.20)"),
        (APART, None, "19 to 21", "camera and lidar disagree (turn by 1.00, T is 0.20)"),
        (QUIET, None, "22, 23", "no expert is active"),
    ],
)
def test_every_row_of_the_algorithm_has_its_lines(experts, human, lines, words):
    for recipe in (HOLD, PLUS):
        line = line_of(step(experts, human), recipe, TAUGHT)
        assert line.lines == lines
        assert line.words.startswith(words)


@pytest.mark.parametrize(
    ("moment", "recipe", "novice", "words"),
    [
        (step(QUIET), PLUS, State(24, 24), "pre-fill: the experts teach before anybody is asked, 24 of 25 labels"),
        (
            step(QUIET, choice=Choice(Driver.NOBODY, (0.0, 0.0), call=Call.FEEDBACK)),
            HOLD,
            State(0, 0),
            "before the first",
        ),
        (step(APART, choice=Choice("lidar", (1.0, 0.0), given=1)), PLUS, TAUGHT, "the human gave lidar control"),
        (
            step(APART, choice=Choice(Driver.NOVICE, NOVICE)),
            PLUS,
            TAUGHT,
            "active: camera and lidar, but the novice is surer",
        ),
        (step((), phase=Phase.PROVE, choice=Choice(Driver.NOVICE, NOVICE)), PLUS, TAUGHT, "the novice drives alone"),
        (step((), phase=Phase.UNSEEN, choice=Choice(Driver.SHIELD, NOVICE)), PLUS, TAUGHT, "the shield turned it away"),
        (step((), choice=Choice(Driver.NOVICE, NOVICE)), None, None, "this method asks no experts"),
    ],
)
def test_what_is_no_line_of_it_is_said_to_be_none(moment, recipe, novice, words):
    line = line_of(moment, recipe, novice)
    assert line.lines == ""
    assert line.words.startswith(words)


def test_an_expert_that_holds_an_action_is_active_for_another_reason_than_one_that_changes_it():
    settings = settings_of(PLUS)
    changing = expert("camera", 0.5, active=True)
    assert activity(changing, 0.06, settings) == "A 0.070 > threshold 0.060: active"
    assert "away from its cruise by more than 0.20" in activity(replace(changing, activation=0.0), 0.06, settings)
    assert activity(replace(changing, active=False, activation=0.01), 0.06, settings).endswith("inactive")
    assert settings_of(Recipe(method_named("hg-dagger"), 0, "line")) is None
