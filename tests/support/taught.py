"""A novice for tests of methods: a small network whose training ends at the poll after it began."""

import numpy as np

from lira.fusion.learning.novice import LearningSettings, NetworkNovice
from lira.fusion.methods.base import Expert
from lira.fusion.preprocess import Features

FEATURES = Features(scan=np.full(101, 0.9, np.float32), image=np.full((32, 32), 0.5, np.float32))


class FixedNetwork:
    def __init__(self, action):
        self.action = action

    def act(self, seen):
        return self.action

    def act_all(self, seen):
        return [self.action] * len(seen)

    def load_weights(self, weights):
        self.loaded = weights


class Trainer:
    """Counts what it is given; has weights at the poll after each start."""

    def __init__(self):
        self.labels, self.started, self.pending = [], 0, False

    def add(self, label):
        self.labels.append(label)

    def start(self, now_s):
        self.started += 1
        self.pending = True

    def poll(self, now_s):
        done, self.pending = self.pending, False
        return {} if done else None

    def close(self):
        pass


def make_novice(action=(0.9, -0.3), *, trained=True, **settings):
    """A novice that always does `action`, and its trainer."""
    trainer = Trainer()
    novice = NetworkNovice(FixedNetwork(action), trainer, LearningSettings(**settings))
    novice.training_steps = int(trained)
    return novice, trainer


def play(name, actions):
    """An expert that plays back actions, one each time it is asked."""
    stream = iter(actions)
    return Expert(name, lambda _: next(stream))
