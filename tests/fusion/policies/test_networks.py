import numpy as np
import pytest
import torch
from nets import camera_net, fusion_net, lidar_net
from torch.nn.functional import leaky_relu

from lira.fusion.policies.networks import ExpertNet, FusionNet, batch_of_one
from lira.fusion.preprocess import Features

RNG = np.random.default_rng(0)
SCAN = RNG.random(101, dtype=np.float32)
IMAGE = RNG.random((32, 32), dtype=np.float32)
DEPTH = RNG.random((32, 32), dtype=np.float32)
SEEN = Features(scan=SCAN, image=IMAGE)


@pytest.mark.parametrize(
    ("network", "parameters"),
    [
        (camera_net(16), 8_754),
        (camera_net(32), 22_114),
        (lidar_net(101), 10_818),
        (lidar_net(130), 12_674),
        (fusion_net(101, 16), 439_666),
        (fusion_net(130, 32), 850_018),
    ],
)
def test_parameter_counts_are_those_of_appendix_b(network, parameters):
    assert sum(parameter.numel() for parameter in network.parameters()) == parameters


def leaky(x):
    return np.where(x > 0, x, 0.3 * x)


def test_the_fusion_network_computes_what_appendix_b_says():
    """Against plain numpy: valid 3x3 convolutions, leaky ReLU 0.3 before the pool, tanh; camera first."""
    network = fusion_net(101, 4, seed=5)
    w = {name: value.astype(np.float64) for name, value in network.weights().items()}

    def convolve(x, weight, bias):
        windows = np.lib.stride_tricks.sliding_window_view(x, (3, 3), axis=(1, 2))
        return np.einsum("chwij,fcij->fhw", windows, weight) + bias[:, None, None]

    hidden = leaky(convolve(IMAGE[None], w["camera.conv1.weight"], w["camera.conv1.bias"]))
    hidden = leaky(convolve(hidden, w["camera.conv2.weight"], w["camera.conv2.bias"]))
    camera = hidden.reshape(4, 14, 2, 14, 2).max(axis=(2, 4)).ravel()
    lidar = SCAN
    for layer in ("lidar.fc1", "lidar.fc2"):
        lidar = leaky(w[f"{layer}.weight"] @ lidar + w[f"{layer}.bias"])
    fused = np.concatenate([camera, lidar])
    for layer in ("fc1", "fc2"):
        fused = leaky(w[f"{layer}.weight"] @ fused + w[f"{layer}.bias"])
    expected = np.tanh(w["out.weight"] @ fused + w["out.bias"])
    np.testing.assert_allclose(network.driving().act(SEEN), expected, atol=1e-5)


def test_initialisation_is_glorot_with_zero_biases_and_depends_on_the_seed_alone():
    torch.manual_seed(1)
    network = fusion_net(101, 16, seed=3)
    torch.manual_seed(2)
    same, other = fusion_net(101, 16, seed=3).weights(), fusion_net(101, 16, seed=4).weights()
    for name, value in network.weights().items():
        np.testing.assert_array_equal(value, same[name])
        if name.endswith("bias"):
            assert not value.any()
        else:
            assert not np.array_equal(value, other[name])
    limit = (6 / (3200 + 128)) ** 0.5
    fc1 = network.weights()["fc1.weight"]
    assert 0.99 * limit < np.abs(fc1).max() <= limit
    assert fc1.std() == pytest.approx(limit / 3**0.5, rel=0.01)


@pytest.mark.parametrize("network", [camera_net(16), lidar_net(101), fusion_net(101, 16)])
def test_one_step_is_what_a_batch_gives(network):
    scans, images = np.stack([SCAN, SCAN]), np.stack([IMAGE * 0, IMAGE])
    batch = network({"image": torch.from_numpy(images), "scan": torch.from_numpy(scans)})
    action = network.driving().act(SEEN)
    np.testing.assert_allclose(action, batch[1].tolist(), atol=1e-5)
    assert all(isinstance(a, float) and -1 <= a <= 1 for a in action)


def test_slopes_come_back_in_the_order_in_memory_of_what_they_belong_to(monkeypatch):
    in_order = []

    def rectified(x, *others, **how):
        out = leaky_relu(x, *others, **how)
        if out.ndim == 4:  # of a picture
            out.register_hook(lambda slope: in_order.append(slope.stride() == out.stride()))
        return out

    monkeypatch.setattr("lira.fusion.policies.networks.leaky_relu", rectified)
    network = fusion_net(101, 16)
    seen = {"image": torch.rand(3, 32, 32), "scan": torch.rand(3, 101)}
    network.features(seen).square().sum().backward()
    assert in_order == [True, True]


def test_an_expert_looks_at_its_own_sensor_only():
    assert camera_net(16).driving().act(Features(image=IMAGE)) == camera_net(16).driving().act(SEEN)
    elsewhere = Features(scan=SCAN, image=IMAGE * 0)
    assert lidar_net(101).driving().act(elsewhere) == lidar_net(101).driving().act(SEEN)


def test_a_novice_can_take_its_experts_trunks():
    camera, lidar = camera_net(16, seed=8), lidar_net(101, seed=9)
    novice = FusionNet.from_experts([camera, lidar], seed=1)
    seen = batch_of_one(SEEN)
    features = novice.features(seen)
    torch.testing.assert_close(features, torch.cat([camera.features(seen), lidar.features(seen)], dim=1))
    torch.testing.assert_close(novice.head(features), novice(seen))
    with torch.no_grad():
        camera.trunk.conv1.weight.zero_()
    torch.testing.assert_close(novice.features(seen), features)


def test_a_third_sensor_is_one_more_trunk_behind_the_others():
    depth = ExpertNet("depth", (32, 32), 16, seed=10)
    experts = [camera_net(16, seed=8), lidar_net(101, seed=9), depth]
    novice = FusionNet.from_experts(experts, seed=1)
    assert list(novice.shapes.items()) == [("image", (32, 32)), ("scan", (101,)), ("depth", (32, 32))]
    assert depth.kind == "depth"
    seen = batch_of_one(Features(scan=SCAN, image=IMAGE, depth=DEPTH))
    torch.testing.assert_close(novice.features(seen), torch.cat([expert.features(seen) for expert in experts], dim=1))
    assert novice(seen).shape == (1, 2)


@pytest.mark.parametrize(
    ("name", "shape", "filters"),
    [("smell", (3,), 16), ("image", (32,), 16), ("image", (32, 16), 16), ("scan", (8, 8), 0), ("depth", (32, 32), 0)],
)
def test_what_no_sensor_gives_is_not_looked_at(name, shape, filters):
    with pytest.raises(ValueError):
        ExpertNet(name, shape, filters)


def test_weights_go_out_and_in():
    source, target = fusion_net(101, 16, seed=1).driving(), fusion_net(101, 16, seed=2).driving()
    weights = {name: array.copy() for name, array in source.weights().items()}
    target.load_weights(weights)
    assert target.act(SEEN) == source.act(SEEN)
    weights["out.bias"][:] = 9.0
    assert target.act(SEEN) == source.act(SEEN)


def broken(change):
    weights = fusion_net(101, 16).weights()
    change(weights)
    return weights


@pytest.mark.parametrize(
    "weights",
    [
        fusion_net(130, 16).weights(),
        fusion_net(101, 32).weights(),
        camera_net(16).weights(),
        broken(lambda w: w.pop("out.bias")),
        broken(lambda w: w.update({"out.bias": np.array([0.0, np.nan], np.float32)})),
        broken(lambda w: w.update({"out.bias": np.zeros(2)})),
    ],
)
def test_weights_that_do_not_fit_change_nothing(weights):
    network = fusion_net(101, 16, seed=2).driving()
    before = network.act(SEEN)
    with pytest.raises(ValueError):
        network.load_weights(weights)
    assert network.act(SEEN) == before
