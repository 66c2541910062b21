"""The novice that learns from each label at once, and the file that drives without it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from nets import before, camera_net, lidar_net

from lira.fusion.inference.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from lira.fusion.inference.kernel_net import KernelNet, unknown
from lira.fusion.learning import kernel_novice
from lira.fusion.learning.kernel_novice import KernelNovice
from lira.fusion.learning.labels import Label, mirror
from lira.fusion.learning.novice import LearningSettings
from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.methods.presets import METHODS
from lira.fusion.policies.kernel import KernelSettings
from lira.fusion.preprocess import Features
from lira.hal.errors import StorageError
from lira.hal.profile import load_profile
from lira.tools.runs.build import build_method

BINS, FILTERS = 21, 4
PRETRAINED = Path(kernel_novice.__file__).parents[1] / "pretrained"


def seen(seed):
    random = np.random.default_rng(seed)
    return Features(scan=random.random(BINS, dtype=np.float32), image=random.random((32, 32), dtype=np.float32))


CAMERA, LIDAR = camera_net(FILTERS, seed=1), lidar_net(BINS, seed=2)


def novice(*, mirrored=True, settings=None, cruises=None, **learning):
    sees = KernelNet.from_experts([CAMERA, LIDAR], cruises)
    learning = LearningSettings(**{"human_weight": 3.0} | learning)
    return KernelNovice(sees, learning, settings or KernelSettings(), mirrored=mirrored)


def taught(count=6, **arguments):
    made = novice(**arguments)
    for i in range(count):
        source = "human" if i % 2 else "camera"
        made.learn(seen(i), (1.0, 1.0 if i % 3 else -1.0), source, made.act(seen(i)))
    return made


def test_it_knows_a_label_at_the_next_step():
    learner = novice()
    assert not learner.trained
    assert learner.act(seen(0)) == (0.0, 0.0)
    assert learner.learn(seen(0), (0.9, -0.7), "human", (0.0, 0.0))
    assert learner.trained
    assert learner.act(seen(0)) == pytest.approx((0.9, -0.7), abs=0.1)


def test_what_it_does_already_is_redundant():
    learner = novice(settings=KernelSettings(noise=0.01))
    learner.learn(seen(0), (0.9, -0.7), "human", learner.act(seen(0)))
    assert not learner.learn(seen(0), (0.9, -0.7), "human", learner.act(seen(0)))
    assert (learner.stored, len(learner.ridge)) == (1, 2)


@pytest.mark.parametrize(("robot", "task", "stored"), [("thesis-sim", "line", False), ("rosbot2", "garden", True)])
def test_on_a_robot_that_turns_faster_than_anybody_drives_it_smaller_turns_are_another_action(robot, task, stored):
    profile = load_profile(robot)
    learner = build_method(METHODS["plus"], profile, 0, InlineTrainer, task).novice
    shape = {"scan": np.ones(profile.features.bins, np.float32), "image": np.zeros((32, 32), np.float32)}
    assert learner.learn(Features(**shape), (1.0, -0.06), "camera", (1.0, 0.0)) is stored
    assert not learner.learn(Features(**shape), (1.0, 0.02), "camera", (1.0, 0.0))


@pytest.mark.parametrize("mirrored", [True, False])
def test_left_and_right_are_exchanged_where_it_is_asked_to(mirrored):
    learner = novice(mirrored=mirrored)
    label = Label(seen(0), (0.9, -0.7), "human", 3.0)
    learner.remember(label)
    other = mirror(label)
    expected = (0.9, 0.7) if mirrored else (0.0, 0.0)
    if mirrored:
        assert learner.act(other.features) == pytest.approx(expected, abs=0.1)
    assert len(learner.ridge) == 1 + mirrored


def test_what_one_source_shows_in_a_row_is_a_group():
    learner = novice()
    for i, source in enumerate(["camera", "camera", "human", "human", "camera"]):
        learner.remember(Label(seen(i), (1.0, 0.0), source))
    assert learner.ridge.groups.tolist() == [1, 1, 1, 1, 2, 2, 2, 2, 3, 3]


def test_a_label_that_all_others_contradict_is_named_with_who_gave_it():
    learner = novice(mirrored=False)
    label = Label(seen(0), (1.0, 0.9), "human")
    for _ in range(5):
        learner.remember(label)
    learner.remember(replace(label, action=(1.0, -0.9), source="camera"))
    (found,) = learner.set_aside()
    assert (found.number, found.source, found.action) == (5, "camera", (1.0, -0.9))
    assert found.others == pytest.approx((1.0, 0.9), abs=0.1)
    assert not found.mirrored
    assert novice().set_aside() == []


def test_of_a_label_that_is_set_aside_it_is_said_whether_itself_or_its_mirror_image():
    learner = novice(mirrored=True)
    for _ in range(5):
        learner.remember(Label(seen(0).mirrored(), (1.0, 0.9), "human"))
    learner.remember(Label(seen(0), (1.0, 0.9), "camera"))  # the others say -0.9 here, by their mirror images
    (found,) = learner.set_aside()
    assert not found.mirrored
    ridge = learner.ridge
    assert ridge.aside == {5: 10}
    assert not ridge.fit.used[10:].any()
    ridge.fit.used[10] = True  # as where little else is known of what was seen than of its mirror image
    (found,) = learner.set_aside()
    assert (found.number, found.action, found.mirrored) == (5, (1.0, 0.9), True)


@pytest.mark.parametrize("mirrored", [True, False])
def test_the_parts_of_all_labels_together_are_the_action(mirrored):
    learner = taught(mirrored=mirrored)
    parts = learner.explain(seen(3))
    linear, angular = np.sum([part.share for part in parts], axis=0)
    assert learner.act(seen(3)) == pytest.approx((linear, angular))
    assert len(parts) == learner.stored
    assert [max(map(abs, part.share)) for part in parts] == sorted(
        (max(map(abs, p.share)) for p in parts), reverse=True
    )
    same = max(parts, key=lambda part: part.likeness)
    assert (same.number, same.source, same.action) == (3, "human", (1.0, -1.0))
    assert same.likeness == pytest.approx(1.0)


def cruises(*, lidar_quiet):
    """The lidar expert's cruise action is what it does on what `seen` shows, or far from it."""
    action = np.array(LIDAR.driving().act(seen(77)))
    return [(1.0, 0.0), tuple(action if lidar_quiet else action + 0.5)]


def test_alone_it_does_what_the_first_expert_does_as_far_as_it_knows_nothing_and_the_others_are_quiet():
    learner = novice(cruises=cruises(lidar_quiet=True))
    first = CAMERA.driving().act(seen(77))
    assert learner.alone(seen(77)) == pytest.approx(first)
    assert learner.act(seen(77)) == (0.0, 0.0)  # it is taught as if nobody did it
    for _ in range(20):
        learner.remember(Label(seen(77), (-0.5, 0.25), "human", 3.0))
    assert learner.alone(seen(77)) == pytest.approx(learner.ridge.act(learner.ridge.x[0], learner.ridge.gain), abs=0.02)


def test_what_the_first_expert_taught_it_is_asked_of_that_expert_itself():
    learner = novice(cruises=cruises(lidar_quiet=True), mirrored=False)
    first = CAMERA.driving().act(seen(77))
    for _ in range(20):  # as where labels of states that look alike say something else
        learner.remember(Label(seen(77), (0.9, -0.9), "camera"))
    assert learner.act(seen(77)) == pytest.approx((0.9, -0.9), abs=0.02)  # it is taught as ever
    assert learner.alone(seen(77)) == pytest.approx(first)
    assert learner.frozen().act(seen(77)) == pytest.approx(first, abs=1e-4)
    assert before(learner.frozen(), halves=True).act(seen(77)) == pytest.approx((0.9, -0.9), abs=0.03)
    older = KernelNovice(before(learner.frozen(), halves=True), LearningSettings(), KernelSettings(), mirrored=False)
    for _ in range(20):
        older.remember(Label(seen(77), (0.9, -0.9), "camera"))
    assert older.alone(seen(77)) == pytest.approx((0.9, -0.9), abs=0.03)  # a log of before, relearned
    for source in ("lidar", "mean", "human"):  # somebody else says no
        taught = novice(cruises=cruises(lidar_quiet=True), mirrored=False)
        for _ in range(20):
            taught.remember(Label(seen(77), (0.9, -0.9), source))
        assert taught.alone(seen(77))[0] == pytest.approx(0.9, abs=0.02)
        assert taught.frozen().act(seen(77)) == pytest.approx(taught.alone(seen(77)), abs=1e-4)


@pytest.mark.parametrize(("turn", "agrees"), [(-0.6, True), (0.6, False)])
def test_where_another_expert_turns_to_its_side_and_it_knows_little_it_turns_as_far_as_what_it_knows_says(turn, agrees):
    settings = KernelSettings(length=0.7, lengths=(), gain=1.0)
    learner = novice(cruises=cruises(lidar_quiet=False), mirrored=False, settings=settings)
    learner.remember(Label(seen(0), (1.0, turn), "human", 1.0))
    assert learner.alone(seen(0)) == pytest.approx(learner.act(seen(0)))  # it knows this
    linear, angular = learner.act(seen(1))
    known = 1.0 - unknown(learner.ridge.k(learner._x(seen(1))), learner.ridge.fit.p)
    assert 0.0 < known < 0.5
    larger = (0.5 / known) ** 0.5 if agrees else 1.0
    assert learner.alone(seen(1)) == pytest.approx((linear, np.clip(angular * larger, -1.0, 1.0)))
    assert learner.frozen().act(seen(1)) == pytest.approx(learner.alone(seen(1)), abs=1e-4)
    assert before(learner.frozen(), halves=True).act(seen(1)) == pytest.approx((linear, angular), abs=1e-4)


def test_where_another_expert_has_something_to_say_it_stands():
    assert novice(cruises=cruises(lidar_quiet=False)).alone(seen(77)) == (0.0, 0.0)
    assert novice().alone(seen(77)) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("camera", "lidar", "side"),
    [(0.5, 0.0, 1.0), (-0.5, 0.0, -1.0), (-0.5, 0.3, 0.0), (0.5, -0.3, 0.0), (0.1, 0.1, 0.0)],
)
def test_where_labels_say_full_steer_to_either_side_it_turns_to_the_one_that_its_first_expert_says(camera, lidar, side):
    """To neither where the lidar expert has something to say, too, or where neither has."""
    here = Features(image=seen(77).image, scan=np.ones(BINS, np.float32))
    did = [np.array(expert.driving().act(here)) for expert in (CAMERA, LIDAR)]
    learner = novice(
        cruises=[tuple(each - (0.0, off)) for each, off in zip(did, (camera, lidar), strict=True)], mirrored=False
    )
    for _ in range(20):
        for turn in (1.0, -1.0):
            learner.remember(Label(here, (1.0, turn), "lidar", 3.0))
    assert learner.alone(here)[1] == pytest.approx(0.0, abs=0.1)  # nobody has said that this expert is right
    learner.remember(Label(here, (1.0, side or 1.0), "human", 0.01))
    assert learner.alone(here)[1] == pytest.approx(side, abs=0.1)
    assert learner.act(here)[1] == pytest.approx(0.0, abs=0.1)  # it is taught as ever
    assert learner.frozen().act(here) == pytest.approx(learner.alone(here), abs=1e-4)


def box(left):
    """A scan of the sizes that the project's experts see, with a box at 0.5 m, so many bins left of its middle."""
    scan = np.ones(101, np.float32)
    scan[50 + left - 16 : 50 + left + 17] = 0.5
    return Features(image=np.ones((32, 32), np.float32), scan=scan)


def of_the_projects_experts():
    """A novice of the experts that come with the project, and what it sees with; the camera's is always quiet here."""
    loaded = [load_checkpoint(PRETRAINED / f"thesis-sim-{name}.safetensors") for name in ("camera", "lidar")]
    (camera, _), (_, of_lidar) = loaded
    sees = KernelNet.from_experts([network for network, _ in loaded], [camera.act(box(0)), of_lidar.cruise])
    return KernelNovice(sees, LearningSettings(), KernelSettings(), mirrored=False), sees


def test_an_expert_that_is_quiet_before_a_box_straight_ahead_hesitates():
    _, sees = of_the_projects_experts()
    assert sees.advice(box(0)).hesitation
    assert not any(sees.advice(box(0)).action)
    for left in (-20, 20):  # there it says something
        advice = sees.advice(box(left))
        assert (advice.given, advice.hesitation, advice.other) == (False, False, 1.0 if left < 0 else -1.0)
    nothing = Features(image=box(0).image, scan=np.ones(101, np.float32))
    assert not sees.advice(nothing).hesitation
    assert any(sees.advice(nothing).action)


@pytest.mark.parametrize("own", [1.0, -1.0])
def test_where_another_expert_hesitates_and_labels_are_undecided_it_turns_to_its_own_side(own):
    learner, _ = of_the_projects_experts()
    for turn in (*(1.0, -1.0) * 20, own):
        learner.remember(Label(box(0), (1.0, turn), "human", 3.0))
    assert abs(learner.act(box(0))[1]) < 0.2  # it is taught as ever
    assert learner.alone(box(0))[1] * own > 0.8
    frozen = learner.frozen()
    assert frozen.act(box(0)) == pytest.approx(learner.alone(box(0)), abs=1e-4)
    assert abs(before(frozen).act(box(0))[1]) < 0.3


def test_an_expert_to_whose_side_the_human_does_not_turn_is_not_asked_for_it():
    did = np.array(CAMERA.driving().act(seen(77)))
    learner = novice(cruises=[tuple(did - (0.0, 0.5)), cruises(lidar_quiet=True)[1]], mirrored=False)
    for turn in (1.0, 1.0, 1.0):
        learner.remember(Label(seen(77), (1.0, turn), "human"))
    assert learner.takes_sides
    learner.remember(Label(seen(77), (1.0, -1.0), "human"))
    assert learner.takes_sides  # three of four
    learner.remember(Label(seen(77), (1.0, -1.0), "human"))
    assert not learner.takes_sides
    assert not learner.frozen().architecture.sides


def test_labels_with_one_mind_are_followed_whatever_the_experts_say():
    learner = novice(cruises=cruises(lidar_quiet=False), mirrored=False)
    for _ in range(20):
        learner.remember(Label(seen(77), (1.0, -0.5), "human", 3.0))
    assert learner.alone(seen(77))[1] == pytest.approx(-0.5 * learner.ridge.gain, abs=0.05)


def test_a_novice_of_plus_falls_back_on_its_experts_and_one_without_does_not():
    profile = load_profile("thesis-sim")
    line = Features(scan=np.ones(profile.features.bins, np.float32), image=np.eye(32, dtype=np.float32))
    for name, falls_back in (("plus", True), ("plus-no-fallback", False), ("hg-dagger-kernel", True)):
        learner = build_method(METHODS[name], profile, 0, InlineTrainer).novice
        assert (learner.alone(line) != (0.0, 0.0)) is falls_back, name


def test_it_is_less_sure_where_it_has_seen_nothing_like_it():
    learner = novice()
    for i in range(6):
        learner.learn(seen(0), (1.0, 0.3 * (-1) ** i), "human", (0.0, 0.0))
    far = Features(scan=np.zeros(BINS, np.float32), image=np.eye(32, dtype=np.float32))
    assert learner.deviation(seen(0))[1] < learner.deviation(far)[1]


def test_two_that_are_taught_the_same_are_the_same_to_the_bit():
    assert taught().act(seen(9)) == taught().act(seen(9))


@pytest.mark.parametrize("cruises", [None, cruises(lidar_quiet=True), cruises(lidar_quiet=False)])
def test_frozen_it_drives_as_the_novice_alone_and_doubts_as_it_does(cruises):
    learner = taught(cruises=cruises)
    network = learner.frozen()
    for each in map(seen, (0, 1, 77)):
        assert network.act(each) == pytest.approx(learner.alone(each), abs=1e-4)
        assert network.deviation(each) == pytest.approx(learner.deviation(each), abs=1e-4)


def test_alone_it_turns_more_than_while_it_is_taught():
    learner = taught(settings=KernelSettings(gain=1.4))
    (linear, angular), alone = learner.act(seen(1)), learner.alone(seen(1))
    assert alone == pytest.approx((linear, max(-1.0, min(1.0, 1.4 * angular))))
    assert abs(alone[1]) > abs(angular)


@pytest.mark.parametrize("proving", [False, True])
def test_several_states_at_once_are_answered_as_one_by_one(proving):
    learner, other = taught(), taught()
    states = [seen(i) for i in range(5)]
    one_by_one = [(other.proving if proving else other.alone)(each) for each in states]
    np.testing.assert_allclose(learner.together(proving=proving)(states), one_by_one, atol=1e-5)
    assert learner.limit == pytest.approx(other.limit, rel=1e-4)


def test_it_knows_what_is_unlike_what_the_human_had_to_show_it():
    learner = novice(mirrored=False)
    assert not learner.knows(seen(0), 0.25)  # before any human
    for i, source in enumerate(["camera", "camera", "camera", "human", "camera", "human"]):
        at = seen(0) if source == "camera" else seen(i)
        learner.remember(Label(at, (1.0, 0.1 * i), source))
    assert learner.knows(seen(0), 0.25)  # three times the same, and no human
    assert not learner.knows(TestDoubt.FAR, 0.25)


class TestDoubt:
    FAR = Features(scan=np.zeros(BINS, np.float32), image=np.eye(32, dtype=np.float32))

    def proven(self):
        learner = taught(12)
        for i in range(4):
            learner.proving(seen(i))
        return learner

    def test_it_doubts_where_it_knows_less_than_anywhere_it_was_proven(self):
        learner = self.proven()
        assert not any(learner.doubts(seen(i)) for i in range(4))
        assert learner.doubts(self.FAR)
        assert learner.frozen().doubts(self.FAR)
        assert not any(learner.frozen().doubts(seen(i)) for i in range(4))

    def test_before_it_was_proven_and_after_another_label_it_has_no_measure_of_doubt(self):
        assert not taught().doubts(self.FAR)
        assert not taught().frozen().doubts(self.FAR)
        learner = self.proven()
        learner.remember(Label(seen(50), (1.0, 0.5), "human"))
        assert not learner.doubts(self.FAR)

    def test_its_measure_is_that_of_every_state_it_met_however_many_are_taken_in_at_once(self, monkeypatch):
        at_once = self.proven().limit
        monkeypatch.setattr(kernel_novice, "MOST_MET", 3)
        assert self.proven().limit == pytest.approx(at_once, rel=1e-9)
        turns = [taught(12).deviation(seen(i))[1] for i in range(4)]
        assert at_once == pytest.approx(max(turns), rel=1e-9)

    def test_what_it_does_does_not_depend_on_being_watched(self):
        learner = taught()
        assert learner.proving(seen(3)) == learner.alone(seen(3))


class TestFile:
    def saved(self, tmp_path, network):
        path = tmp_path / "novice.safetensors"
        about = Checkpoint.of(network, "thesis-sim", "lira demo", 0)
        save_checkpoint(path, network, about)
        return path

    def test_it_goes_to_a_file_and_comes_back_with_all_it_was_taught(self, tmp_path):
        network = taught().frozen()
        back, about = load_checkpoint(self.saved(tmp_path, network))
        assert about.kind == "kernel"
        assert back.act(seen(3)) == network.act(seen(3))

    @pytest.mark.parametrize("examples", [-1, 10**9])
    def test_a_number_of_examples_that_nobody_has_taught_is_refused(self, tmp_path, examples):
        path = tmp_path / "novice.safetensors"
        network = taught().frozen()
        save_checkpoint(path, network, replace(Checkpoint.of(network, "thesis-sim", "lira demo", 0), examples=examples))
        with pytest.raises(StorageError, match=r"does not hold what it says.*examples"):
            load_checkpoint(path)

    def test_one_that_was_taught_nothing_stands(self, tmp_path):
        back, _ = load_checkpoint(self.saved(tmp_path, novice().frozen()))
        assert back.act(seen(3)) == (0.0, 0.0)

    @pytest.mark.parametrize(
        "damage",
        [
            lambda weights: weights | {"y": weights["y"][:-1]},
            lambda weights: weights | {"noise": -weights["noise"]},
            lambda weights: weights | {"lengths": np.zeros(2, np.float32)},
            lambda weights: weights | {"x": weights["x"][:, 1:]},
            lambda weights: weights | {"gain": np.full(1, np.nan, np.float32)},
            lambda weights: {name: value for name, value in weights.items() if name != "y"},
            lambda weights: weights | {name: weights[name][:-1] for name in ("x", "y", "noise")},
        ],
    )
    def test_one_that_does_not_fit_is_refused(self, tmp_path, damage):
        network = taught().frozen()
        weights = damage(network.weights())
        network.weights = lambda: weights
        with pytest.raises(StorageError, match="does not hold what it says"):
            load_checkpoint(self.saved(tmp_path, network))
