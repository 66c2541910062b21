import numpy as np
import pytest
from nets import camera_net, lidar_net

from lira.fusion.learning.labels import Label, is_rest, mirror
from lira.fusion.learning.learner import Learner
from lira.fusion.policies.networks import FusionNet
from lira.fusion.preprocess import Features


def labels(count, seed=0):
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        scan, gray = rng.random(101, dtype=np.float32), rng.integers(0, 256, (32, 32))
        seen = Features(scan=scan, image=(gray / 255).astype(np.float32))
        made.append(Label(seen, (float(rng.random()), float(scan[0])), "human"))
    return made


def test_the_mirror_image_of_a_label_reverses_what_is_seen_and_the_turn():
    (label,) = labels(1)
    other = mirror(label)
    seen, mirrored = label.features, other.features
    assert (mirrored.scan[0], mirrored.scan[100]) == (seen.scan[100], seen.scan[0])
    assert mirrored.image[3, 0] == seen.image[3, 31]
    assert other.action == (label.action[0], -label.action[1])
    again = mirror(other)
    for name, array in again.features.items():
        np.testing.assert_array_equal(array, seen[name])
    assert again.action == label.action


@pytest.mark.parametrize("frozen", [True, False])
def test_learning_mirrored_is_learning_both_labels_in_their_order(frozen):
    network = FusionNet.from_experts([camera_net(16, seed=1), lidar_net(101, seed=2)])
    mirrored = Learner(network, seed=0, frozen_trunks=frozen, mirrored=True)
    both = Learner(network, seed=0, frozen_trunks=frozen)
    for label in labels(20):
        mirrored.add(label)
        both.add(label)
        both.add(mirror(label))
    assert len(mirrored) == len(both) == 40
    assert mirrored.train_step() == both.train_step()
    for name, value in mirrored.weights().items():
        np.testing.assert_array_equal(value, both.weights()[name])


@pytest.mark.parametrize("frozen", [True, False])
def test_labels_beyond_the_memory_teach_the_same(frozen):
    """The trunks see them in batches instead of one by one, which may round differently."""
    network = FusionNet.from_experts([camera_net(16, seed=1), lidar_net(101, seed=2)])
    near = Learner(network, seed=0, frozen_trunks=frozen)
    far = Learner(network, seed=0, frozen_trunks=frozen, resident_bytes=20 * (12_800 if frozen else 1_428))
    for label in labels(60):
        near.add(label)
        far.add(label)
    assert far._resident == 20
    assert far._spilled.count == 40
    assert far.train_step() == pytest.approx(near.train_step(), rel=0.02)
    if frozen:  # otherwise convolutions in half precision may round far apart
        for name, value in near.weights().items():
            np.testing.assert_allclose(far.weights()[name], value, atol=2e-3, err_msg=name)


def test_an_idle_frame_is_neither_driven_nor_turned():
    assert is_rest((0.0, -1e-7))
    assert not is_rest((0.0, 0.01))
