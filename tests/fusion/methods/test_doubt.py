"""HG-DAgger's doubt against numbers worked out by hand; the ensemble leaves the novice alone."""

import math

import numpy as np
import pytest
from nets import camera_net, lidar_net
from taught import FEATURES, make_novice

from lira.fusion.inference.build import alone
from lira.fusion.learning.learner import Label, Learner
from lira.fusion.methods.base import STAND
from lira.fusion.methods.doubt import DoubtLog, doubt, threshold
from lira.fusion.methods.rivals.hg_dagger import HgDagger
from lira.fusion.methods.stop_and_ask import Doubtful
from lira.fusion.policies.ensemble import EnsembleNet
from lira.fusion.policies.networks import FusionNet
from lira.fusion.preprocess import Features
from lira.hal.messages import Call


def opinions(spread):
    """Two policies whose speeds differ by 2 * spread: a variance of 2 * spread^2, and none in the turn."""
    return np.array([[0.5 + spread, 0.1], [0.5 - spread, 0.1]], np.float32)


def test_doubt_is_the_norm_of_the_variances():
    actions = np.array([[0.0, 0.2], [0.6, 0.2], [0.3, 0.8]], np.float32)
    # sample variances: (0.09 + 0.09 + 0) / 2 and (0.04 + 0.04 + 0.16) / 2
    assert doubt(actions) == pytest.approx(math.hypot(0.09, 0.12))
    assert doubt(opinions(0.5)) == pytest.approx(0.5)
    assert doubt(opinions(0.0)) == 0.0


@pytest.mark.parametrize(
    ("doubts", "tau"), [([], math.inf), ([4.0], 4.0), ([9, 9, 9, 1], 1), ([9, 9, 9, 9, 2, 4], 3), ([8] * 6 + [1, 3], 2)]
)
def test_the_threshold_is_the_mean_of_the_last_quarter(doubts, tau):
    assert threshold(doubts) == tau


def test_doubts_are_logged_once_per_take_over_and_only_when_there_was_something_to_doubt():
    novice, _ = make_novice(trained=False)
    spread = [0.0]
    log = DoubtLog(lambda _: doubt(opinions(spread[0])))
    method = HgDagger(novice, log)

    def drive(*humans):
        for human in humans:
            method.learn(method.propose(FEATURES), human)

    drive((1.0, 0.0), None, (1.0, 0.0))
    assert log.doubts == []
    novice.training_steps = 1
    spread[0] = 0.5
    drive((1.0, 0.0), None, (1.0, 0.0), (1.0, 0.0), None)
    spread[0] = 1.0
    drive((1.0, 0.0))
    method.reset()
    drive((1.0, 0.0))
    assert log.doubts == pytest.approx([0.5, 2.0, 2.0])


def test_above_the_threshold_it_stands_and_asks_and_goes_on_when_it_is_sure():
    spread = [0.5]
    log = DoubtLog(lambda _: doubt(opinions(spread[0])))
    alone = Doubtful(lambda _: (0.9, 0.1), log.exceeds)
    assert alone.propose(FEATURES).choice.call is Call.NONE  # nobody ever took over
    log.take_over(FEATURES)
    assert alone.propose(FEATURES).command == (0.9, 0.1)  # as sure as then
    spread[0] = 0.6
    proposal = alone.propose(FEATURES)
    assert (proposal.choice.driver, proposal.command, proposal.choice.call) == ("novice", STAND, Call.FEEDBACK)
    assert alone.policy("novice")(FEATURES) == STAND  # who looks ahead sees that nothing moves
    lesson = alone.learn(proposal, (0.3, 0.3))
    assert (lesson.choice.driver, lesson.choice.label, lesson.stored) == ("human", None, False)
    spread[0] = 0.1
    assert alone.propose(FEATURES).command == (0.9, 0.1)


def labels(count):
    rng = np.random.default_rng(0)
    for _ in range(count):
        scan, image = rng.random(101, dtype=np.float32), rng.integers(0, 256, (32, 32)) / 255
        yield Label(Features(scan=scan, image=image.astype(np.float32)), (float(scan[0]), -0.5), "human")


@pytest.mark.parametrize("frozen", [True, False])
def test_the_ensemble_learns_too_and_changes_nothing_for_the_novice(frozen):
    plain = FusionNet.from_experts([camera_net(16, seed=4), lidar_net(101, seed=5)], seed=1)
    ensemble = EnsembleNet(plain, members=3, seed=7)
    seen = next(labels(1)).features
    before = ensemble.driving().opinions(seen)
    assert before.shape == (3, 2)
    assert doubt(before) > 0
    learners = [Learner(each, seed=2, frozen_trunks=frozen) for each in (plain, ensemble)]
    for learner in learners:
        for label in labels(40):
            learner.add(label)
        for _ in range(2):
            learner.train_step()
    for network, learner in zip((plain, ensemble), learners, strict=True):
        network.load_weights(learner.weights())
    for name, value in plain.weights().items():
        np.testing.assert_array_equal(ensemble.weights()[name], value, err_msg=name)
        np.testing.assert_array_equal(alone(ensemble.driving()).weights()[name], value, err_msg=name)
    after = ensemble.driving().opinions(seen)
    assert np.median(np.abs(after[:, 1] + 0.5)) < 0.15 < np.median(np.abs(before[:, 1] + 0.5))  # they have learned
    assert len({tuple(row) for row in after.tolist()}) == 3  # and none the same
