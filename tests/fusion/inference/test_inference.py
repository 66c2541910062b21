"""Networks as they drive, held to the same networks as they train; and what drives needs no torch."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch
from fresh import python
from nets import camera_net, fusion_net, kernel_net, lidar_net, noise

from lira.fusion.inference.architecture import Architecture
from lira.fusion.inference.build import alone, driving
from lira.fusion.inference.networks import REMEMBERED
from lira.fusion.inference.trunks import PictureTrunk, ScanTrunk
from lira.fusion.policies.ensemble import EnsembleNet
from lira.fusion.policies.kernel import KernelRidge, KernelSettings
from lira.fusion.policies.networks import ExpertNet, FusionNet, batch_of_one
from lira.fusion.preprocess import Features

BINS = {16: 101, 32: 130}


@pytest.mark.parametrize("filters", BINS)
@pytest.mark.parametrize(
    "make", [fusion_net, lambda _, f, **a: camera_net(f, **a), lambda b, _, **a: lidar_net(b, **a)]
)
def test_what_drives_does_what_torch_does(make, filters):
    network = make(BINS[filters], filters, seed=3)
    for bias in (tensor for name, tensor in network.named_parameters() if name.endswith("bias")):
        torch.nn.init.uniform_(bias, -0.5, 0.5, generator=torch.Generator().manual_seed(len(bias)))
    driver = network.driving()
    for seed in range(20):
        seen = noise(BINS[filters], seed)
        with torch.inference_mode():
            inputs = batch_of_one(seen)
            expected, features = network(inputs)[0].tolist(), network.features(inputs)[0].numpy()
        np.testing.assert_allclose(driver.features(seen), features, atol=1e-5)
        assert driver.act(seen) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("px", [6, 7, 24, 31, 32])
def test_pictures_of_any_size_are_seen(px):
    network = ExpertNet("depth", (px, px), 3, seed=2)
    seen = Features(depth=np.random.default_rng(0).random((px, px), dtype=np.float32))
    with torch.inference_mode():
        expected = network(batch_of_one(seen))[0].tolist()
    assert network.driving().act(seen) == pytest.approx(expected, abs=1e-5)


def test_an_ensemble_s_opinions_are_those_of_torch_and_alone_it_has_none():
    ensemble = EnsembleNet(fusion_net(101, 16, seed=1), members=3, seed=7)
    driver, seen = ensemble.driving(), noise(101)
    with torch.inference_mode():
        expected = ensemble.member_heads(ensemble.features(batch_of_one(seen)))[:, 0].numpy()
    np.testing.assert_allclose(driver.opinions(seen), expected, atol=1e-5)
    assert alone(driver).act(seen) == driver.act(seen)
    assert "member_weights.0" not in alone(driver).weights()


def test_a_kernel_s_page_and_what_drives_agree():
    n, rng = 40, np.random.default_rng(4)
    blank = kernel_net(101, 16, seed=6)
    what = Architecture("kernel", blank.architecture.shapes, 16, examples=n)
    ridge = KernelRidge(dict(zip(what.shapes, what.trunk_sizes, strict=True)), KernelSettings(contradicts=None))
    for i, action in enumerate(rng.uniform(-1, 1, (n, 2)).tolist()):
        ridge.add(blank.see(noise(101, i)), tuple(action), 1.0, human=True, group=i, label=i)
    weights = blank.weights() | {
        "x": ridge.x,
        "y": ridge.y.astype(np.float32),
        "noise": np.full(n, KernelSettings().noise, np.float32),
        "lengths": ridge.lengths.astype(np.float32),
        "scale": ridge.fit.scale.astype(np.float32),
        "gain": np.full(1, 1.3, np.float32),
    }
    network = driving(what, weights)
    for seen in (noise(101, 3), noise(101, 99)):
        x = blank.see(seen)
        assert network.act(seen) == pytest.approx(ridge.act(x, gain=1.3), abs=1e-5)
        assert network.deviation(seen) == pytest.approx(ridge.fit.deviation(ridge.k(x)), abs=1e-5)


@pytest.mark.parametrize("network", [fusion_net(101, 16), lidar_net(101), kernel_net(101, 16)])
def test_on_several_observations_at_once_it_does_what_it_does_on_each(network):
    driver = network.driving() if isinstance(network, torch.nn.Module) else network
    seen = [noise(101, seed) for seed in range(4)]
    np.testing.assert_allclose(driver.act_all(seen), [driver.act(each) for each in seen], atol=1e-6)
    assert driver.act_all(seen) == driver.act_all(seen)
    assert driver.act_all([]) == []


def test_what_experts_and_novice_see_with_the_same_trunk_is_looked_at_once_a_step(monkeypatch):
    looked = []
    look = PictureTrunk._look
    monkeypatch.setattr(PictureTrunk, "_look", lambda self, seen: looked.append(1) or look(self, seen))
    camera = camera_net(16, seed=4)
    novice = FusionNet.from_experts([camera, lidar_net(101, seed=5)], seed=1).driving()
    others = [camera.driving(), novice, kernel_net(101, 16, seed=4)]
    for k in range(3):
        for network in others:
            network.act(noise(101, k))
        assert len(looked) == k + 1


def test_who_is_asked_with_half_of_its_view_need_not_look_at_the_whole_again(monkeypatch):
    looked = []
    look = ScanTrunk._look
    monkeypatch.setattr(ScanTrunk, "_look", lambda self, seen: looked.append(1) or look(self, seen))
    seen, lidar = noise(101), lidar_net(101, seed=4).driving()
    novice = kernel_net(101, 16, seed=4, cruises=[(1.0, 0.0), lidar.act(seen)])  # the lidar's is quiet
    del looked[:]
    novice.act(seen)
    halves = len(looked)
    assert halves in (1, 2)  # it need not look at the second if the first says enough
    assert lidar.act(seen)
    assert len(looked) == halves


def test_a_picture_that_changes_in_its_place_is_seen_anew():
    network, seen = camera_net(16, seed=4).driving(), noise(101)
    before = network.act(seen)
    seen.image[:] = 1.0 - seen.image
    after = network.act(seen)
    assert after == camera_net(16, seed=4).driving().act(Features(image=seen.image.copy()))
    assert after != before


def test_what_a_teacher_has_foreseen_is_not_computed_again(monkeypatch):
    network, looked = fusion_net(101, 16, seed=4).driving(), []
    features = network.features
    monkeypatch.setattr(network, "features", lambda seen: looked.append(1) or features(seen))
    foreseen = [network.act(noise(101, step)) for step in range(15)]
    assert [network.act(noise(101, step)) for step in range(15)] == foreseen
    assert len(looked) == 15
    network.act(Features(image=noise(101, 0).image, scan=noise(101, 1).scan))
    assert len(looked) == 16


def test_what_is_long_ago_is_forgotten_and_all_of_it_with_other_weights():
    network, other = (fusion_net(101, 16, seed=seed).driving() for seed in (4, 5))
    before = [network.act(noise(101, step)) for step in range(2 * REMEMBERED)]
    assert len(network._lately) == REMEMBERED
    assert [network.act(noise(101, step)) for step in range(2 * REMEMBERED)] == before
    network.load_weights(other.weights())
    assert network.act(noise(101, 0)) == other.act(noise(101, 0)) != before[0]


def test_threads_that_ask_at_once_do_not_disturb_each_other():
    networks = [camera_net(16, seed=4).driving() for _ in range(2)]  # with one trunk between them
    expected = [networks[0].features(noise(101, seed)).copy() for seed in range(4)]
    wrong = []

    def ask(network):
        for k in range(400):
            if not np.array_equal(network.features(noise(101, k % 4)), expected[k % 4]):
                wrong.append(k)

    with ThreadPoolExecutor() as pool:
        list(pool.map(ask, networks))
    assert not wrong


@pytest.mark.parametrize(
    ("kind", "shapes", "filters"),
    [
        ("camera", {"scan": (101,)}, 16),
        ("camera", {"image": (32, 32)}, 0),
        ("fusion", {}, 16),
        ("fusion", {"smell": (3,)}, 16),
        ("camera", {"image": (32, 32), "scan": (101,)}, 16),
    ],
)
def test_what_cannot_be_is_no_architecture(kind, shapes, filters):
    with pytest.raises(ValueError):
        Architecture(kind, shapes, filters)


@pytest.mark.parametrize(
    "network", [camera_net(4), lidar_net(9), fusion_net(9, 4), EnsembleNet(fusion_net(9, 4), 2, 0)]
)
def test_an_architecture_knows_the_weights_of_what_trains(network):
    assert network.architecture.weights == {name: tuple(each.shape) for name, each in network.state_dict().items()}


BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("torch", "pybullet", "joblib", "matplotlib", "pygame"):
            raise AssertionError(f"{name} is imported")

sys.meta_path.insert(0, Blocked())
import lira.tools.live.sitting, lira.tools.verbs.learn.drive
import lira.tools.runs.remote.alone, lira.tools.runs.remote.with_person
from lira.fusion.methods.presets import method_named
from lira.tools.runs.build import build_method
from lira.fusion.experts.load import load_alone
from lira.hal.profile import load_profile
import numpy as np, lira
seen = lira.Features(scan=np.ones(101, np.float32), image=np.ones((32, 32), np.float32))
for policy in ("camera-expert", "lidar-expert"):
    print(load_alone(policy, load_profile("thesis-sim"), shield=True).propose(seen).choice.driver)
plus = build_method(method_named("plus"), load_profile("thesis-sim"), 0, trainer=None)
plus.learn(plus.propose(seen), (1.0, 0.5))
print(plus.novice.stored, plus.novice.act(seen)[0] > 0.5)
"""


def test_driving_and_teaching_by_plus_need_neither_torch_nor_a_simulator():
    done = python(BLOCKED)
    assert (done.stdout.split(), done.stderr) == (["camera", "lidar", "1", "True"], "")
