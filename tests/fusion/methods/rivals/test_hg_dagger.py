import numpy as np
import pytest
from nets import camera_net

from lira.fusion.learning.novice import LearningSettings, NetworkNovice
from lira.fusion.methods.base import STAND
from lira.fusion.methods.rivals.hg_dagger import HgDagger
from lira.fusion.preprocess import Features
from lira.hal.messages import Call

FEATURES = Features(scan=np.zeros(101, np.float32), image=np.zeros((32, 32), np.float32))
FAR = (-1.0, 1.0)  # from anything a fresh network does


class Trainer:
    """Has new weights at the poll after each start."""

    def __init__(self, network):
        self.weights, self.labels, self.pending = network.weights(), [], False

    def add(self, label):
        self.labels.append(label)

    def start(self, now_s):
        self.pending = True

    def poll(self, now_s):
        done, self.pending = self.pending, False
        return self.weights if done else None

    def close(self):
        pass


@pytest.fixture
def method():
    network = camera_net(16)
    return HgDagger(NetworkNovice(network.driving(), Trainer(network), LearningSettings(labels_per_step=2)))


def train(method):
    for _ in range(2):
        method.learn(method.propose(FEATURES), FAR)
    for now_s in (0.0, 0.2):
        method.update(now_s)
    assert method.novice.trained


def test_before_the_first_training_step_it_stands_and_asks_the_human_to_drive(method):
    choice = method.propose(FEATURES).choice
    assert (choice.driver, choice.action, choice.label, choice.call) == ("none", STAND, None, Call.FEEDBACK)


def test_afterwards_the_novice_drives_and_nobody_is_called(method):
    train(method)
    proposal = method.propose(FEATURES)
    assert (proposal.choice.driver, proposal.choice.call) == ("novice", Call.NONE)
    assert proposal.command == proposal.choice.action == method.novice.act(FEATURES)


def test_only_what_the_human_drives_is_learned(method):
    train(method)
    lesson = method.learn(method.propose(FEATURES), None)
    assert (lesson.choice.driver, lesson.choice.label, lesson.stored) == ("novice", None, False)
    lesson = method.learn(method.propose(FEATURES), FAR)
    assert (lesson.choice.driver, lesson.choice.label, lesson.stored) == ("human", FAR, True)
    assert method.novice.stored == 3


def test_a_label_that_the_novice_knows_already_is_given_and_not_stored(method):
    train(method)
    proposal = method.propose(FEATURES)
    lesson = method.learn(proposal, proposal.novice)
    assert (lesson.choice.label, lesson.stored) == (proposal.novice, False)


def test_the_novice_is_the_only_policy(method):
    assert method.policy("novice")(FEATURES) == method.novice.act(FEATURES)
    with pytest.raises(KeyError):
        method.policy("human")
