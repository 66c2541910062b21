"""Experts and methods of somebody's own, by name: what they may be, and what is said when they are something else."""

import sys

import msgspec
import numpy as np
import pytest

from lira.fusion.control import ControlLoop
from lira.fusion.experts.load import load_policy
from lira.fusion.methods.base import Alone, Choice, Expert, Method, Proposal
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.methods.lira import LiraSettings
from lira.fusion.methods.presets import Preset, file_name, method_named
from lira.fusion.preprocess import Features
from lira.hal.errors import ConfigError, PluginError
from lira.hal.profile import load_profile
from lira.hal.safety.governed import govern
from lira.hal.testing import NullRobot

PROFILE = load_profile("thesis-sim")
SEEN = Features(scan=np.ones(101, np.float32), image=np.ones((36, 36), np.float32))
LAB = """
import lira
from lira.fusion.methods.presets import Preset

class Mine(lira.Method):
    def __init__(self, context):
        self.experts = context.experts
    def propose(self, features):
        return lira.Proposal(features, lira.Choice("mine", (0.5, 0.0)))

class Settings(lira.MethodSettings, frozen=True):
    speed: float = 0.5
    def build(self, context):
        return Mine(context)

fast = Settings(speed=1.0)
scratch = Preset("scratch", Settings(), trunks="scratch")
broken = lambda context: 42
number = 3

def wall(seen):
    return 2.0, -0.25

class Walls:
    def __init__(self, profile):
        self.bins = profile.features.bins
    def __call__(self, seen):
        return 1.0, self.bins / 1000

quick = lira.Expert("careful", wall, cruise=(0.3, 0.0))
mute = lambda seen: None
lost = lambda seen: (float("nan"), 0.0)
wordy = lambda seen: (1.0, 0.0, 0.0)
"""


@pytest.fixture(autouse=True)
def _lab(tmp_path, monkeypatch):
    (tmp_path / "ownlab.py").write_text(LAB)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("ownlab", None)


def context():
    return Context(
        PROFILE, (Expert("one", lambda _: (0.0, 0.0)),), 0, lambda **_: pytest.fail("no novice is asked for")
    )


@pytest.mark.parametrize("name", ["ownlab:Mine", "ownlab:Settings", "ownlab:fast", "ownlab:scratch"])
def test_a_method_may_be_a_class_settings_or_a_preset(name):
    preset = method_named(name)
    assert (preset.name, preset.kind) == (name, name)
    method = preset.build(context())
    assert isinstance(method, Method)
    assert method.propose(SEEN).command == (0.5, 0.0)
    assert preset.trunks == ("scratch" if name.endswith("scratch") else "frozen")


def test_a_method_of_ones_own_is_written_down_by_its_name_and_told_by_its_source():
    preset = method_named("ownlab:fast")
    assert msgspec.json.decode(msgspec.json.encode(preset), type=Preset) == preset
    assert preset.approach.source() == LAB.encode()
    assert method_named("hold").approach.source() == b""
    assert file_name("deep/own.lab:fast") == "deep-own-lab-fast"
    assert file_name("hg-dagger-m10") == "hg-dagger-m10"


def test_what_is_no_method_is_refused():
    with pytest.raises(ConfigError, match=r"'ownlab:number' is a int.*lira\.MethodSettings"):
        method_named("ownlab:number")
    with pytest.raises(PluginError, match="'ownlab:broken' built a int and no method"):
        method_named("ownlab:broken").build(context())


@pytest.mark.parametrize(("name", "action"), [("wall", (1.0, -0.25)), ("Walls", (1.0, 0.101)), ("quick", (1.0, -0.25))])
def test_an_expert_may_be_a_function_a_class_or_an_expert_and_is_clipped(name, action):
    expert = load_policy(f"ownlab:{name}", PROFILE)
    assert expert.name == {"quick": "careful"}.get(name, name)
    assert expert.act(SEEN) == pytest.approx(action)
    assert expert.cruise == ((0.3, 0.0) if name == "quick" else (1.0, 0.0))


@pytest.mark.parametrize(("name", "answer"), [("mute", "None"), ("lost", "(nan, 0.0)"), ("wordy", "(1.0, 0.0, 0.0)")])
def test_an_expert_that_answers_with_no_action_is_named(name, answer):
    with pytest.raises(PluginError) as failed:
        load_policy(f"ownlab:{name}", PROFILE).act(SEEN)
    assert failed.value.what == f"the policy 'ownlab:{name}' answered {answer}"


def test_a_black_box_as_it_is_is_checked_like_one_that_is_loaded():
    def bold(seen):
        return 3.0, -3.0

    for given, name in ((bold, "bold"), (Expert("mine", bold, cruise=(0.1, 0.0)), "mine")):
        expert = load_policy(given, PROFILE)
        assert (expert.name, expert.act(SEEN)) == (name, (1.0, -1.0))
    with pytest.raises(PluginError, match="the policy 'mute' answered None"):
        load_policy(Expert("mute", lambda _: None), PROFILE).act(SEEN)


def test_what_is_no_expert_is_refused():
    with pytest.raises(ConfigError, match=r"policy 'ownlab:number' is a int.*lira\.Features"):
        load_policy("ownlab:number", PROFILE)


class Bold(Method):
    """As little as a method can be."""

    def propose(self, features):
        return Proposal(features, Choice("bold", (1.0, 0.0)))


def test_a_method_needs_no_more_than_to_propose():
    method = Bold()
    proposal = method.propose(SEEN)
    method.reset()
    method.update(1.0)
    assert not method.learns
    assert method.alone("prove") is method
    assert not method.calls_alone
    assert method.learn(proposal, None).choice is proposal.choice
    assert method.learn(proposal, (0.1, 0.2)).choice == Choice("human", (0.1, 0.2))
    method.close()


def test_who_learns_by_default_takes_the_humans_actions_as_labels_and_then_drives_alone():
    class Parrot(Bold):
        def __init__(self):
            self.novice = Echo()

    class Echo(type(Bold().novice)):
        def __init__(self):
            self.labels = []

        def act(self, features):
            return self.labels[-1].action

        def remember(self, label):
            super().remember(label)
            self.labels.append(label)

    method = Parrot()
    lesson = method.learn(method.propose(SEEN), (0.3, 0.4))
    assert (lesson.stored, lesson.choice.label) == (True, (0.3, 0.4))
    assert method.learns
    assert method.novice.stored == 1
    alone = method.alone("unseen")
    assert isinstance(alone, Alone)
    assert alone.propose(SEEN).command == (0.3, 0.4)


def test_only_who_knows_two_beginnings_can_be_told_which():
    assert LiraSettings().starting("experts") == LiraSettings(start="experts")
    with pytest.raises(ConfigError, match="takes no --start"):
        MethodSettings.starting(method_named("hg-dagger").approach, "human")


def test_a_method_that_proposes_nothing_is_named():
    class Silent(Method):
        def propose(self, features):
            return None

    with govern(NullRobot(PROFILE)) as robot:
        loop = ControlLoop(robot)
        with pytest.raises(PluginError, match=r"test_own:.*Silent proposed None"):
            loop.step(Silent())
