import numpy as np
import pytest
import torch
from lessons import BINS, labels
from nets import camera_net, fusion_net, lidar_net
from torch import nn

from lira.fusion.learning.learner import Label, Learner
from lira.fusion.policies.networks import FusionNet

SIZES = (BINS, 8)


def error(network, made: list[Label]) -> float:
    return float(np.mean([np.subtract(network.driving().act(one.features), one.action) ** 2 for one in made]))


def trained(network, *, seed=1, steps=2, frozen=False, made=None, **settings) -> Learner:
    learner = Learner(network, seed=seed, frozen_trunks=frozen, **settings)
    for label in made or labels(60):
        learner.add(label)
    for _ in range(steps):
        learner.train_step()
    return learner


@pytest.mark.parametrize("frozen", [False, True])
def test_training_learns_and_leaves_the_given_network_alone(frozen):
    network, fresh = fusion_net(*SIZES), labels(50, seed=9)
    before = error(network, fresh)
    weights = trained(network, frozen=frozen, steps=3).weights()
    assert error(network, fresh) == before
    network.load_weights(weights)
    assert error(network, fresh) < 0.1 * before


@pytest.mark.parametrize(("network", "k"), [(lidar_net(101), 0), (camera_net(SIZES[1]), 1)])
def test_experts_learn_from_their_own_sensor(network, k):
    fresh = labels(50, seed=9)
    network.load_weights(trained(network, steps=4).weights())
    wrong = [abs(network.driving().act(one.features)[k] - one.action[k]) for one in fresh]
    assert np.mean(wrong) < 0.15


@pytest.mark.parametrize("frozen", [False, True])
def test_one_seed_gives_one_result(frozen):
    first, second, other = (
        trained(fusion_net(*SIZES), frozen=frozen, seed=seed, updates=8).weights() for seed in (1, 1, 2)
    )
    for name in first:
        np.testing.assert_array_equal(first[name], second[name])
    assert not np.array_equal(first["fc1.weight"], other["fc1.weight"])


def test_the_losses_fall_and_are_means_of_the_squared_error():
    learner = Learner(fusion_net(*SIZES), seed=0, frozen_trunks=True, learning_rate=0.0)
    made = labels(20)
    for label in made:
        learner.add(label)
    losses = [learner.train_step() for _ in range(10)]
    assert np.mean(losses) == pytest.approx(error(fusion_net(*SIZES), made), rel=0.05)
    learner = trained(fusion_net(*SIZES), steps=0)
    assert learner.train_step() > learner.train_step() > learner.train_step()


def test_frozen_trunks_stay_and_training_the_head_on_kept_features_equals_the_full_forward():
    network = FusionNet.from_experts([camera_net(SIZES[1], seed=4), lidar_net(101, seed=5)])
    before, made = network.weights(), labels(40)
    weights = trained(network, frozen=True, steps=1, made=made).weights()
    for name, value in weights.items():
        assert np.array_equal(value, before[name]) == name.startswith(("camera", "lidar")), name

    # The same step by hand: plain Adam over the head, whole forward pass, the same draws.
    head = [p for name, p in network.named_parameters() if not name.startswith(("camera", "lidar"))]
    adam = torch.optim.Adam(head, lr=1e-3, foreach=False)
    seen = {name: torch.from_numpy(np.stack([one.features[name] for one in made])) for name in ("image", "scan")}
    actions = torch.tensor([one.action for one in made])
    for pick in np.random.default_rng(1).integers(40, size=(50, 32)):
        loss = nn.functional.mse_loss(network({name: array[pick] for name, array in seen.items()}), actions[pick])
        adam.zero_grad()
        loss.backward()
        adam.step()
    for name, value in network.weights().items():
        np.testing.assert_allclose(weights[name], value, atol=2e-4, err_msg=name)


def test_full_training_stays_close_to_plain_float32(monkeypatch):
    """Half-precision convolutions, where the processor has them, change little."""
    made, fresh = labels(60), labels(50, seed=9)
    fast = trained(fusion_net(*SIZES), made=made, steps=3, updates=25).weights()
    monkeypatch.setattr("lira.fusion.learning.learner._has_bfloat16", lambda: False)
    exact = trained(fusion_net(*SIZES), made=made, steps=3, updates=25).weights()
    networks = fusion_net(*SIZES), fusion_net(*SIZES)
    for network, weights in zip(networks, (fast, exact), strict=True):
        network.load_weights(weights)
    apart = [
        np.subtract(networks[0].driving().act(one.features), networks[1].driving().act(one.features)) for one in fresh
    ]
    assert np.abs(apart).mean() < 0.05


def test_two_training_steps_go_on_as_one_of_twice_the_length():
    """Warm start, and the optimiser's state is kept."""
    two, one = trained(lidar_net(101), steps=2).weights(), trained(lidar_net(101), steps=1, updates=100).weights()
    for name in two:
        np.testing.assert_array_equal(two[name], one[name])


def test_a_label_of_weight_zero_teaches_nothing():
    made = labels(30)
    unwanted = [Label(one.features, (1.0, -1.0), "camera", 0.0) for one in labels(30, seed=3)]
    network = fusion_net(*SIZES)
    network.load_weights(trained(network, made=made + unwanted, steps=4).weights())
    assert error(network, made) < 0.05


def test_labels_may_come_between_training_steps_and_outgrow_the_arrays():
    learner = trained(lidar_net(101), made=labels(63), steps=1)
    for label in labels(300, seed=5):
        learner.add(label)
    learner.train_step()
    assert len(learner) == 363


def test_without_labels_there_is_nothing_to_learn():
    with pytest.raises(ValueError, match="nothing to learn"):
        Learner(lidar_net(101), seed=0, frozen_trunks=False).train_step()
