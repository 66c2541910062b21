"""What `plus` adds to Algorithm 1: pre-fill, reservation, control to an expert, and no call where it is sure."""

import numpy as np
import pytest
from nets import fusion_net

from lira.fusion.learning.novice import LearningSettings, NetworkNovice
from lira.fusion.log.recorder import Journal
from lira.fusion.methods.base import Alone, Chooser, Expert
from lira.fusion.methods.lira import LiraSettings, LiraSpf
from lira.fusion.methods.plus import LiraPlus, PlusSettings
from lira.fusion.preprocess import Features
from lira.hal.messages import Call

PERIOD_S = 0.2
BINS = 101
NETWORK = fusion_net(BINS, 16, seed=3).driving()
CRUISE, LEFT, RIGHT = (1.0, 0.0), (1.0, 0.8), (1.0, -0.8)
BARE = PlusSettings(prefill=0, reserve_s=0.0, handover_s=0.0, sure=None)


def seen(brightness=0.5, nearness=1.0):
    rng = np.random.default_rng(int(1e3 * brightness + 1e6 * nearness))
    scan = np.full(BINS, nearness, np.float32) * rng.uniform(0.99, 1.0, BINS).astype(np.float32)
    image = np.full((32, 32), brightness, np.float32) * rng.uniform(0.99, 1.0, (32, 32)).astype(np.float32)
    return Features(scan=scan, image=image)


class Shelf:
    """A trainer that only collects."""

    pending = False

    def __init__(self):
        self.labels = []
        self.steps = 0

    def add(self, label):
        self.labels.append(label)

    def start(self, now_s):
        self.steps += 1

    def poll(self, now_s):
        return None

    def close(self):
        pass


class Scene:
    """A method with two experts that do as they are told, and the labels it has stored."""

    def __init__(self, settings, *, trained=True, **learning):
        self.camera, self.lidar = CRUISE, CRUISE
        self.shelf = Shelf()
        self.novice = NetworkNovice(NETWORK, self.shelf, LearningSettings(**learning))
        self.novice.training_steps = int(trained)
        experts = [Expert("camera", lambda _: self.camera), Expert("lidar", lambda _: self.lidar)]
        self.method = LiraPlus(experts, self.novice, settings, PERIOD_S)

    def step(self, human=None, features=None):
        proposal = self.method.propose(features or seen())
        return proposal, self.method.learn(proposal, human)

    def warm(self):
        """Let the experts' memories fill."""
        for _ in range(5):
            self.step()

    @property
    def sources(self):
        return [label.source for label in self.shelf.labels]


def test_with_everything_off_it_is_lira():
    scene, script = Scene(BARE), [(CRUISE, CRUISE)] * 5 + [(LEFT, CRUISE), (LEFT, RIGHT), (LEFT, LEFT), (CRUISE, RIGHT)]
    experts = [Expert("camera", lambda _: scene.camera), Expert("lidar", lambda _: scene.lidar)]
    plain = LiraSpf(experts, scene.novice, LiraSettings(), PERIOD_S)
    for scene.camera, scene.lidar in script:
        ours, theirs = scene.method.propose(seen()), plain.propose(seen())
        assert ours.choice == theirs.choice
        assert ours.speed == theirs.speed


class TestPrefill:
    def scene(self):
        return Scene(PlusSettings(prefill=8, reserve_s=0.0), trained=False)

    def test_the_first_expert_drives_and_teaches_while_nobody_else_is_active(self):
        scene = self.scene()
        proposal, lesson = scene.step()
        assert (proposal.choice.driver, proposal.choice.action) == ("camera", CRUISE)
        assert lesson.stored
        assert scene.sources == ["camera"]

    def test_another_expert_alone_drives_but_does_not_teach(self):
        scene = self.scene()
        scene.warm()
        scene.lidar = LEFT
        proposal, lesson = scene.step()
        assert (proposal.choice.driver, proposal.choice.call) == ("lidar", Call.ATTENTION)
        assert not lesson.stored

    def test_the_human_is_called_where_they_disagree_and_slowed_down_for(self):
        scene = self.scene()
        scene.warm()
        scene.camera, scene.lidar = LEFT, RIGHT
        proposal, lesson = scene.step()
        assert (proposal.choice.driver, proposal.choice.call, lesson.stored) == ("camera", Call.FEEDBACK, False)
        assert proposal.speed < 1.0

    def test_it_ends_with_so_many_labels(self):
        scene = self.scene()
        for _ in range(12):
            proposal, _ = scene.step()
        assert proposal.choice.driver != "camera"
        assert len(scene.shelf.labels) == 8


class TestReservation:
    def scene(self):
        scene = Scene(PlusSettings(prefill=0, handover_s=0.0))
        scene.warm()
        scene.camera = LEFT
        return scene

    def test_a_label_is_stored_when_nobody_has_objected_for_a_second(self):
        scene = self.scene()
        lessons = [scene.step()[1] for _ in range(6)]
        assert all(lesson.reserved and not lesson.stored for lesson in lessons)
        assert [len(lesson.settled) for lesson in lessons] == [0, 0, 0, 0, 0, 1]
        assert scene.sources == ["camera"]

    def test_a_take_over_drops_what_the_expert_has_just_done(self):
        scene = self.scene()
        for _ in range(4):
            scene.step()
        _, lesson = scene.step(human=RIGHT)
        assert [settled.stored for settled in lesson.settled] == [False] * 4
        assert scene.sources == ["human"]

    def test_the_journal_writes_a_label_once_with_what_became_of_it(self, taken):
        kept = []
        journal = Journal(keep=kept.append)
        scene = self.scene()
        for k in range(6):
            journal.note(taken(scene, k), phase="train", lap=1, layout=0, training_steps=1)
        assert [(label.observation, label.source, label.stored) for label in kept] == [(0, "camera", True)]
        journal.note(taken(scene, 6, human=RIGHT), phase="train", lap=1, layout=0, training_steps=1)
        assert [label.observation for label in kept] == [0, 6, 1, 2, 3, 4, 5]
        assert [label.stored for label in kept] == [True, True] + [False] * 5
        assert journal.ledger.account.stored == {"camera": 1, "human": 1}


@pytest.fixture
def taken():
    from lira.fusion.control import Step
    from lira.hal.messages import Applied, Observation, Reason, Source, Twist

    def take(scene, seq, human=None):
        proposal, lesson = scene.step(human)
        applied = Applied(Twist(0.0, 0.0), 0.0, Source.POLICY, Reason.OK, (), seq, 0.0)
        return Step(Observation(seq, seq * PERIOD_S, None, None, None), proposal, applied, lesson, None)

    return take


class TestWheel:
    def scene(self):
        scene = Scene(PlusSettings(prefill=0, reserve_s=0.0, handover_s=0.6))
        scene.warm()
        return scene

    def test_an_expert_that_is_given_the_wheel_drives_and_teaches_for_a_while(self):
        scene = self.scene()
        scene.camera, scene.lidar = LEFT, RIGHT
        assert scene.method.choose("lidar") is None
        steps = [scene.step()[0] for _ in range(4)]
        assert [step.choice.driver for step in steps] == ["lidar"] * 3 + ["novice"]
        assert [step.choice.call for step in steps] == [Call.NONE] * 3 + [Call.FEEDBACK]
        assert scene.sources == ["lidar"] * 3

    def test_the_human_can_take_it_back(self):
        scene = self.scene()
        scene.method.choose("lidar")
        scene.step()
        scene.step(human=LEFT)
        assert scene.step()[0].choice.driver == "novice"

    def test_nobody_else_can_be_chosen(self):
        scene = self.scene()
        assert isinstance(scene.method, Chooser)
        assert "no expert 'sonar'" in scene.method.choose("sonar")
        assert Scene(BARE).method.offers == {}

    def test_each_time_has_its_number(self):
        scene = self.scene()
        given = []
        for name in ("lidar", "lidar", "camera"):
            scene.method.choose(name)
            given += [scene.step()[0].choice.given for _ in range(4)]
        assert given == [1, 1, 1, 0, 2, 2, 2, 0, 3, 3, 3, 0]


def test_the_human_s_labels_weigh_more():
    scene = Scene(BARE, human_weight=3.0)
    scene.warm()
    scene.camera = LEFT
    scene.step()
    scene.step(human=RIGHT)
    assert [(label.source, label.weight) for label in scene.shelf.labels] == [("camera", 1.0), ("human", 3.0)]


@pytest.mark.parametrize(("knows", "call"), [(True, Call.NONE), (False, Call.FEEDBACK)])
def test_where_the_experts_disagree_nobody_is_called_if_the_novice_knows(knows, call):
    scene = Scene(PlusSettings(prefill=0, reserve_s=0.0, handover_s=0.0, sure=0.25))
    scene.novice.knows = lambda _, share: knows and share == 0.25
    scene.warm()
    scene.camera, scene.lidar = LEFT, RIGHT
    proposal, lesson = scene.step()
    assert (proposal.choice.driver, proposal.choice.call) == ("novice", call)
    assert proposal.speed == (1.0 if call is Call.NONE else 0.3)
    assert not lesson.stored


def test_a_novice_that_cannot_tell_is_never_sure():
    scene = Scene(PlusSettings(prefill=0, reserve_s=0.0, handover_s=0.0, sure=1.0))
    scene.warm()
    scene.camera, scene.lidar = LEFT, RIGHT
    assert scene.step()[0].choice.call is Call.FEEDBACK


def test_it_asks_on_unseen_layouts_only_and_only_if_it_is_told_to():
    silent, asking = Scene(BARE), Scene(PlusSettings(ask=True))
    assert not silent.method.calls_alone
    assert asking.method.calls_alone
    for scene, phase in ((silent, "prove"), (silent, "unseen"), (asking, "prove")):
        assert isinstance(scene.method.alone(phase), Alone)
    asking.novice.doubts = lambda features: features.scan.min() < 0.5
    alone = asking.method.alone("unseen")
    assert alone.propose(seen()).choice.call is Call.NONE
    assert alone.propose(seen(nearness=0.2)).choice.call is Call.FEEDBACK


class TestPractice:
    def scene(self, *, practice):
        scene = Scene(PlusSettings(prefill=0, reserve_s=0.0, handover_s=0.0, practice=practice))
        scene.warm()
        scene.camera, scene.lidar = LEFT, RIGHT
        scene.novice.alone = lambda _: (1.0, 0.4)
        return scene

    def test_from_its_first_examination_on_the_novice_drives_as_alone_and_learns_from_the_human_only(self):
        scene = self.scene(practice=True)
        proposal, _ = scene.step()
        assert (proposal.choice.driver, proposal.choice.call) == ("novice", Call.FEEDBACK)
        scene.method.alone("prove")
        proposal, lesson = scene.step()
        assert (proposal.choice.driver, proposal.choice.call, proposal.command) == ("novice", Call.NONE, (1.0, 0.4))
        assert not lesson.stored
        assert scene.method.policy("novice")(seen()) == (1.0, 0.4)
        assert scene.step(human=(1.0, 0.45))[1].stored is False  # it does that alone
        assert scene.step(human=(1.0, -1.0))[1].stored
        assert scene.sources[-1] == "human"

    def test_it_is_off_unless_it_is_asked_for(self):
        scene = self.scene(practice=False)
        scene.method.alone("prove")
        assert scene.step()[0].choice.call is Call.FEEDBACK
