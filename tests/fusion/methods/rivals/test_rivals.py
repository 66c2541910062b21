"""When each rival hands control over and back, and what it learns; against numbers worked out by hand."""

import math

import numpy as np
import pytest
from taught import FEATURES, make_novice

from lira.fusion.methods.base import STAND
from lira.fusion.methods.doubt import DoubtLog
from lira.fusion.methods.rivals.ensemble_dagger import EnsembleDagger, EnsembleDaggerSettings
from lira.fusion.methods.rivals.gated import RobotGated, discrepancy
from lira.fusion.methods.rivals.intervention_weighted import OWN, InterventionWeighted
from lira.fusion.methods.rivals.lazy_dagger import LazyDagger, LazyDaggerSettings
from lira.fusion.methods.rivals.probe import START, Probe
from lira.fusion.methods.rivals.thrifty_dagger import ThriftyDagger, ThriftyDaggerSettings
from lira.fusion.preprocess import Features
from lira.hal.messages import Call

NOVICE = (0.9, -0.3)
FAR = (1.0, 1.0)


def step(method, human=None):
    """One pass of the loop; returns who drove, and what the method had proposed."""
    proposal = method.propose(FEATURES)
    return method.learn(proposal, human).choice.driver, proposal


class Switch(RobotGated):
    """Two rules that do as they are told."""

    def __init__(self, novice):
        self.over = self.back = False
        super().__init__(novice)

    def hands_over(self, features, a_n):
        return self.over

    def hands_back(self, features, a_n, a_h):
        return self.back


def test_before_it_has_learned_anything_the_person_drives_and_no_rule_is_asked():
    novice, _ = make_novice(trained=False)
    method = Switch(novice)
    method.over = True
    proposal = method.propose(FEATURES)
    assert (proposal.choice.driver, proposal.command, proposal.choice.call) == ("none", STAND, Call.FEEDBACK)


def test_it_stands_and_calls_until_the_person_is_needed_no_longer():
    method = Switch(make_novice(NOVICE)[0])
    assert step(method)[1].command == NOVICE
    method.over = True
    driver, asked = step(method)
    assert (driver, asked.command, asked.choice.call) == ("novice", STAND, Call.FEEDBACK)
    assert method.policy("novice")(FEATURES) == STAND  # who looks ahead sees that nothing moves
    method.over = False
    assert step(method)[1].choice.call is Call.FEEDBACK  # nobody came: it goes on asking
    driver, asked = step(method, FAR)
    assert (driver, asked.relieves) == ("human", False)
    method.back = True
    step(method, FAR)
    assert method.policy("novice")(FEATURES) == NOVICE
    relieved = method.propose(FEATURES)
    assert (relieved.command, relieved.choice.call, relieved.relieves) == (NOVICE, Call.NONE, True)
    method.learn(relieved, FAR)
    assert method.propose(FEATURES).relieves  # a hand that does not let go is asked again
    step(method)
    assert not method.propose(FEATURES).relieves


def test_a_hand_that_came_uncalled_goes_when_it_likes():
    method = Switch(make_novice(NOVICE)[0])
    step(method, FAR)
    method.over = True  # asked only while the robot drives
    assert step(method, FAR)[1].choice.call is Call.NONE
    assert step(method)[1].relieves is False
    assert step(method)[1].choice.call is Call.FEEDBACK


def test_an_episode_begins_with_the_robot_driving():
    method = Switch(make_novice(NOVICE)[0])
    method.over = True
    step(method)
    method.reset()
    method.over = False
    assert step(method)[1].command == NOVICE


def test_what_the_person_does_is_learned_whoever_wanted_it():
    novice, trainer = make_novice(NOVICE)
    method = Switch(novice)
    step(method, FAR)
    step(method)
    method.over = True
    step(method)
    step(method, FAR)
    assert [label.source for label in trainer.labels] == ["human", "human"]


@pytest.mark.parametrize(
    ("doubt", "human", "over", "back"),
    [(0.05, NOVICE, False, True), (0.15, NOVICE, True, False), (0.05, (0.9, 0.3), False, False)],
)
def test_ensemble_dagger_needs_both_rules_to_drive_and_doubt_alone_to_call(doubt, human, over, back):
    settings = EnsembleDaggerSettings(tau=0.25, chi=0.1)
    method = EnsembleDagger(make_novice(NOVICE)[0], DoubtLog(lambda _: doubt), settings)
    assert method.hands_over(FEATURES, NOVICE) is over
    assert method.hands_back(FEATURES, NOVICE, human) is back


def test_ensemble_daggers_doubt_may_come_to_what_it_was_when_a_hand_came_uncalled():
    doubts = [0.4]
    method = EnsembleDagger(make_novice(NOVICE)[0], DoubtLog(lambda _: doubts[0]), EnsembleDaggerSettings())
    assert step(method)[1].choice.call is Call.NONE  # nobody ever came
    step(method, FAR)
    step(method, FAR)
    step(method)
    assert method.chi == 0.4
    doubts[0] = 0.5
    assert step(method)[1].choice.call is Call.FEEDBACK
    step(method, FAR)  # called: that says nothing about chi
    assert method.chi == 0.4


def test_the_discrepancy_is_the_squared_distance():
    assert discrepancy((0.5, -0.2), (0.8, 0.2)) == pytest.approx(0.25)


class Told:
    """A probe that predicts what it is told and remembers what it is shown."""

    def __init__(self):
        self.value, self.shown, self.fits = 0.0, [], 0

    def add(self, features, action, target):
        self.shown.append(target)

    def fit(self):
        self.fits += 1

    def predict(self, features, action):
        return self.value


def test_lazy_dagger_judges_the_novice_before_it_learns_and_hands_back_later_than_over():
    probe = Told()
    method = LazyDagger(make_novice(NOVICE)[0], probe, LazyDaggerSettings(beta_h=0.25, beta_r=0.04, every=2))
    step(method, (0.9, 0.3))  # 0.36 away: more than beta_H
    step(method, (0.9, 0.1))  # 0.16
    step(method)
    assert (probe.shown, probe.fits) == ([1.0, 0.0], 1)
    probe.value = 0.51
    assert step(method)[1].choice.call is Call.FEEDBACK
    step(method, (0.9, 0.0))  # 0.09: below beta_H, and not yet below beta_R
    assert method.propose(FEATURES).choice.call is Call.FEEDBACK
    step(method, (0.9, -0.2))
    assert method.propose(FEATURES).relieves


def thrifty(**changes):
    probe = Told()
    doubts = [0.0]
    settings = ThriftyDaggerSettings(**{"alpha": 0.1, "gamma": 0.5, "every": 1, **changes})
    return ThriftyDagger(make_novice(NOVICE)[0], lambda _: doubts[0], probe, settings), probe, doubts


def test_thrifty_daggers_risk_falls_with_the_steps_before_a_hand_had_to_come():
    method, probe, _ = thrifty()
    for _ in range(3):
        step(method)
    step(method, FAR)
    step(method, FAR)
    assert probe.shown == [0.5, 0.25, 0.125]
    step(method)
    method.reset()
    assert probe.shown[3:] == [0.0]  # an episode that ended without anybody


def test_a_hand_that_was_called_is_no_sign_of_risk():
    method, probe, doubts = thrifty()
    step(method)
    method.delta_h, doubts[0] = 0.5, 1.0
    step(method)  # it calls
    step(method, FAR)
    assert probe.shown == [0.0, 0.0]


def test_thrifty_daggers_thresholds_follow_from_its_budget():
    method, probe, doubts = thrifty(window=100)
    for k in range(100):  # and once more with the last values, when the hand comes: the window is full
        doubts[0], probe.value = k / 100, k / 200
        step(method)
    assert (method.delta_h, method.beta_h, method.beta_r) == (math.inf, math.inf, math.inf)
    step(method, (0.9, 0.3))
    assert method.delta_h == pytest.approx(0.901)
    assert method.beta_h == pytest.approx(0.4505)
    assert method.beta_r == pytest.approx(0.2525)
    assert method.delta_r == pytest.approx(0.36)
    doubts[0], probe.value = 0.0, 0.5
    step(method)
    assert step(method)[1].choice.call is Call.FEEDBACK  # risky
    assert not method.hands_back(FEATURES, NOVICE, NOVICE)
    probe.value = 0.2
    assert method.hands_back(FEATURES, NOVICE, NOVICE)
    assert not method.hands_back(FEATURES, NOVICE, (0.9, 0.4))


def test_a_probe_says_nothing_until_it_has_seen_enough_and_then_tells_rare_places_apart():
    probe = Probe(seed=0)
    near = Features(scan=np.full(101, 0.1, np.float32), image=FEATURES.image)
    for _ in range(START - 1):
        probe.add(FEATURES, NOVICE, 0.0)
    probe.fit()
    assert probe.predict(near, NOVICE) == 0.0
    probe.add(near, NOVICE, 1.0)
    for _ in range(3):
        probe.fit()
    assert probe.predict(near, NOVICE) > 0.8 > 0.2 > probe.predict(FEATURES, NOVICE)


def sources(before, robot_steps, human_steps):
    novice, trainer = make_novice(NOVICE)
    method = InterventionWeighted(novice, before, seed=0)
    for _ in range(robot_steps):
        step(method)
    for _ in range(human_steps):
        step(method, FAR)
    return trainer.labels


def test_as_many_of_the_robots_steps_are_learned_as_the_human_gave_labels():
    labels = sources(0, 10, 3)
    assert [label.source for label in labels] == ["human", OWN] * 3
    assert {label.action for label in labels if label.source == OWN} == {NOVICE}
    assert [label.source for label in sources(0, 2, 4)] == ["human", OWN, "human", OWN, "human", "human"]


def test_what_led_to_an_intervention_is_not_repeated():
    assert [label.source for label in sources(5, 6, 3)] == ["human", OWN, "human", "human"]
    assert [label.source for label in sources(5, 5, 2)] == ["human"] * 2


def test_what_the_human_does_not_teach_anything_by_brings_nothing_of_the_robots_own():
    novice, trainer = make_novice(NOVICE)
    method = InterventionWeighted(novice, 0, seed=0)
    step(method)
    step(method, NOVICE)
    assert trainer.labels == []
