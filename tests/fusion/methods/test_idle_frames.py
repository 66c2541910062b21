"""The dead-man is held and the stick rests: a label or none, as the settings say, in the same way for every method."""

import numpy as np
import pytest
from nets import camera_net

from lira.fusion.learning.novice import LearningSettings, NetworkNovice
from lira.fusion.methods.base import Expert
from lira.fusion.methods.lira import PRESETS, LiraSpf
from lira.fusion.methods.rivals.hg_dagger import HgDagger
from lira.fusion.preprocess import Features

FEATURES = Features(scan=np.zeros(101, np.float32), image=np.zeros((32, 32), np.float32))
REST, CREEP = (0.0, 0.0), (0.0, 0.01)


class Collector:
    """A trainer that only takes labels."""

    pending = False

    def __init__(self):
        self.actions = []

    def add(self, label):
        self.actions.append(label.action)

    def poll(self, now_s):
        return None


def make_lira(novice):
    experts = [Expert(name, lambda _: (1.0, 0.0)) for name in ("camera", "lidar")]
    return LiraSpf(experts, novice, PRESETS["hold"], period_s=0.2)


@pytest.mark.parametrize("make", [make_lira, HgDagger], ids=["lira", "hg-dagger"])
@pytest.mark.parametrize(("settings", "kept"), [({}, [REST, CREEP]), ({"idle_frames": "skip"}, [CREEP])])
def test_an_idle_frame_is_a_label_unless_the_settings_skip_it(make, settings, kept):
    collector = Collector()
    method = make(NetworkNovice(camera_net(16).driving(), collector, LearningSettings(filter_human=False, **settings)))
    lessons = [method.learn(method.propose(FEATURES), action) for action in (REST, CREEP)]
    assert collector.actions == kept
    assert [lesson.choice.label for lesson in lessons if lesson.stored] == kept
    assert [(lesson.choice.driver, lesson.choice.action) for lesson in lessons] == [("human", REST), ("human", CREEP)]


@pytest.mark.parametrize("make", [make_lira, HgDagger], ids=["lira", "hg-dagger"])
def test_a_frame_that_is_left_out_is_not_given_either(make):
    method = make(NetworkNovice(camera_net(16).driving(), Collector(), LearningSettings(idle_frames="skip")))
    assert method.learn(method.propose(FEATURES), REST).choice.label is None
