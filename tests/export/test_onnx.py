"""A network as ONNX, run by somebody else's runtime: the same actions, for one observation and for many."""

import json
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from nets import before

from lira.fusion.inference.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from lira.fusion.inference.kernel_net import KernelNet
from lira.fusion.learning.kernel_novice import KernelNovice
from lira.fusion.learning.labels import Label
from lira.fusion.learning.novice import LearningSettings
from lira.fusion.policies.kernel import KernelSettings
from lira.fusion.policies.networks import FusionNet
from lira.fusion.preprocess import Features
from lira.hal.errors import StorageError
from lira.tools.cli import main
from lira.tools.export.onnx_file import build, write_onnx

PRETRAINED = sorted((Path(__file__).parents[2] / "fusion" / "pretrained").glob("*.safetensors"))
SHAPES = {"image": (32, 32), "scan": (101,)}
CLOSE = 1e-5


def seeing(shapes, seed):
    """Something to see, a picture's values multiples of 1/255."""
    rng = np.random.default_rng(seed)
    return Features(**{name: (rng.integers(0, 256, shape) / 255).astype(np.float32) for name, shape in shapes.items()})


def ask(model, seen):
    """What a runtime makes of some observations together, by output."""
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    names = [each.name for each in session.get_outputs()]
    together = {name: np.stack([each[name] for each in seen]) for name in seen[0]}
    return dict(zip(names, session.run(None, together), strict=True))


def about(network):
    return Checkpoint.of(network, "thesis-sim", "a test", seed=1, cruise=(1.0, 0.0))


def nothing_near(seen):
    return Features(image=seen["image"], scan=np.ones(SHAPES["scan"], np.float32))


def box_ahead(seen, near):
    scan = np.ones(SHAPES["scan"], np.float32)
    scan[34:67] = near
    return Features(image=seen["image"], scan=scan)


def seeing_as_experts(falls_back=True):
    loaded = [load_checkpoint(path) for path in PRETRAINED if path.stem in ("thesis-sim-camera", "thesis-sim-lidar")]
    cruises = [about.cruise for _, about in loaded] if falls_back else None
    return KernelNet.from_experts([network for network, _ in loaded], cruises)


def novice_of_plus(falls_back=True):
    """One that was shown something."""
    novice = KernelNovice(seeing_as_experts(falls_back), LearningSettings(), KernelSettings(), mirrored=True)
    rng = np.random.default_rng(5)
    for k in range(12):
        source = "human" if k % 4 < 2 else "camera"
        novice.remember(Label(seeing(SHAPES, k), tuple(rng.uniform(-1.0, 1.0, 2).tolist()), source))
    return novice.frozen()


@pytest.mark.parametrize("path", PRETRAINED, ids=lambda path: path.stem)
def test_an_expert_does_the_same(path):
    network, checkpoint = load_checkpoint(path)
    seen = [seeing(checkpoint.features, seed) for seed in range(5)]
    model = build(network, checkpoint)
    np.testing.assert_allclose(ask(model, seen)["action"], [network.act(each) for each in seen], atol=CLOSE)
    np.testing.assert_allclose(ask(model, seen[:1])["action"], [network.act(seen[0])], atol=CLOSE)


@pytest.mark.parametrize("filters", [16, 32])
def test_a_novice_does_the_same(filters):
    network = FusionNet(SHAPES, filters, seed=4).driving()
    seen = [seeing(SHAPES, seed) for seed in range(5)]
    np.testing.assert_allclose(
        ask(build(network, about(network)), seen)["action"], [network.act(each) for each in seen], atol=CLOSE
    )


@pytest.mark.parametrize("falls_back", [True, False])
def test_a_novice_of_plus_does_the_same_and_says_how_sure_it_is(falls_back):
    network = novice_of_plus(falls_back)
    seen = [seeing(SHAPES, seed) for seed in range(3, 30, 4)]  # some of them it was shown
    seen += map(nothing_near, list(seen))
    advice = [network.advice(each) for each in seen]
    assert any(each.action.any() for each in advice) is falls_back
    assert not all(each.action.any() for each in advice)
    got = ask(build(network, about(network)), seen)
    np.testing.assert_allclose(got["action"], [network.act(each) for each in seen], atol=CLOSE)
    np.testing.assert_allclose(got["deviation"], [network.deviation(each) for each in seen], atol=CLOSE)
    nothing = Features(**{name: np.zeros(shape, np.float32) for name, shape in SHAPES.items()})
    assert np.isfinite(ask(build(network, about(network)), [nothing])["action"]).all()


def test_one_that_takes_its_first_experts_side_does_the_same():
    sees = seeing_as_experts()
    novice = KernelNovice(sees, LearningSettings(), KernelSettings(contradicts=None), mirrored=True)
    undecided, seen = nothing_near(seeing(SHAPES, 15)), [nothing_near(seeing(SHAPES, k)) for k in range(3, 30, 4)]
    for turn in (1.0, -1.0):
        novice.remember(Label(undecided, (1.0, turn), "lidar", 3.0))
    for each in seen[:3]:  # where the human agrees with that expert
        novice.remember(Label(each, (1.0, sees.advice(each).side), "human", 0.01))
    network = novice.frozen()
    assert network.architecture.sides
    assert sees.advice(undecided).side * network.act(undecided)[1] > 0.7
    got = ask(build(network, about(network)), [undecided, *seen, seeing(SHAPES, 15)])
    expected = [network.act(each) for each in (undecided, *seen, seeing(SHAPES, 15))]
    np.testing.assert_allclose(got["action"], expected, atol=CLOSE)


def test_one_that_goes_by_itself_where_an_expert_hesitates_does_the_same():
    sees = seeing_as_experts()
    novice = KernelNovice(sees, LearningSettings(), KernelSettings(contradicts=None), mirrored=True)
    boxes = [box_ahead(seeing(SHAPES, seed), near) for seed in (3, 7, 11) for near in (0.4, 0.5, 0.6)]
    hesitating = [each for each in boxes if sees.advice(each).hesitation]
    assert hesitating
    for each in hesitating:
        for turn in (1.0, -1.0, 0.5):
            novice.remember(Label(each, (1.0, turn), "human", 3.0))
    network = novice.frozen()
    actions = [network.act(each) for each in boxes]
    assert max(abs(turn) for _, turn in actions) > 0.7
    np.testing.assert_allclose(ask(build(network, about(network)), boxes)["action"], actions, atol=CLOSE)
    for older in (before(network), before(network, halves=True)):
        actions = [older.act(each) for each in boxes]
        np.testing.assert_allclose(ask(build(older, about(older)), boxes)["action"], actions, atol=CLOSE)


@pytest.mark.parametrize("names", [("lidar",), ("camera", "lidar", "depth-table-top-depth")])
def test_of_however_many_experts_it_does_the_same(names):
    loaded = [load_checkpoint(PRETRAINED[0].with_name(f"thesis-sim-{name}.safetensors")) for name in names]
    sees = KernelNet.from_experts([network for network, _ in loaded], [of.cruise for _, of in loaded])
    shapes = sees.architecture.shapes
    novice = KernelNovice(sees, LearningSettings(), KernelSettings(length=1.0, lengths=()), mirrored=True)
    for k, source in enumerate(names * 2):
        novice.remember(Label(seeing(shapes, k), (0.9, 0.7 * (-1.0) ** k), source))
    network = novice.frozen()
    seen = [seeing(shapes, seed) for seed in range(20)]
    got = ask(build(network, about(network)), seen)
    np.testing.assert_allclose(got["action"], [network.act(each) for each in seen], atol=CLOSE)


def test_a_file_says_what_it_is_and_the_verb_writes_it(tmp_path, capsys):
    network = novice_of_plus()
    given, out = tmp_path / "novice.safetensors", tmp_path / "novice.onnx"
    save_checkpoint(given, network, about(network))
    assert main(["export", "onnx", str(given), str(out)]) == 0
    assert "kernel novice" in capsys.readouterr().out
    model = onnx.load(out)
    said = {each.key: each.value for each in model.metadata_props}
    assert (said["kind"], said["profile"], said["provenance"]) == ("kernel", "thesis-sim", "a test")
    assert json.loads(said["features"]) == {"image": [32, 32], "scan": [101]}
    assert float(said["limit"]) > 0.0
    assert [each.name for each in model.graph.input] == ["image", "scan"]
    assert main(["export", "onnx", str(given), str(out)]) == 2  # nothing is written over
    assert "is there already" in capsys.readouterr().err


def test_what_cannot_be_written_or_read_is_said(tmp_path, capsys):
    assert main(["export", "onnx", str(tmp_path / "none.safetensors"), str(tmp_path / "out.onnx")]) == 2
    assert "there is no checkpoint" in capsys.readouterr().err
    network = FusionNet(SHAPES, 4).driving()
    with pytest.raises(StorageError, match="cannot write"):
        write_onnx(network, about(network), tmp_path / "no" / "folder.onnx")
