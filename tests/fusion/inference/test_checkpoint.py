import json
import os
from dataclasses import replace

import numpy as np
import pytest
from nets import before, camera_net, fusion_net, kernel_net, lidar_net, noise, shapes
from safetensors.numpy import save_file

from lira.fusion.experts.files import shipped_path
from lira.fusion.inference.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from lira.fusion.inference.kernel_net import KernelNet
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.preprocess import Features
from lira.hal.errors import StorageError
from lira.hal.profile import load_profile

SEEN = noise(101)
FALLS_BACK = kernel_net(101, 16, cruises=[(1.0, 0.0), (0.9, 0.1)])
AS_BEFORE = before(FALLS_BACK)
TAKES_SIDES = KernelNet(replace(FALLS_BACK.architecture, sides=True), FALLS_BACK.weights())
SHAPES = shapes(101)


def checkpoint(kind="fusion", **changes) -> Checkpoint:
    names = {"camera": ["image"], "lidar": ["scan"]}.get(kind, [*SHAPES])
    fields = {"features": {name: SHAPES[name] for name in names}, "filters": 0 if kind == "lidar" else 16}
    fields |= {"profile": "thesis-sim", "cruise": None, "provenance": "a test", "seed": 7}
    return Checkpoint(kind, **(fields | changes))


@pytest.mark.parametrize(
    ("network", "about"),
    [
        (camera_net(16, seed=1), checkpoint("camera", cruise=(0.98, -0.01), labels=270, training_steps=9)),
        (camera_net(8, px=24, seed=1), checkpoint("camera", filters=8, features={"image": (24, 24)})),
        (lidar_net(101, seed=2), checkpoint("lidar", provenance='lira train-expert lidar "ä"')),
        (fusion_net(101, 16, seed=3), checkpoint()),
        (kernel_net(101, 16), checkpoint("kernel")),
        (FALLS_BACK, checkpoint("kernel", fallback=True, halves=True, asks=True)),
        (TAKES_SIDES, checkpoint("kernel", fallback=True, halves=True, asks=True, sides=True)),
        (AS_BEFORE, checkpoint("kernel", fallback=True)),
    ],
)
def test_what_is_saved_is_loaded(tmp_path, network, about):
    path = tmp_path / "new" / "one.safetensors"
    save_checkpoint(path, network, about)
    loaded, found = load_checkpoint(path)
    assert found == about
    assert loaded.architecture == network.architecture
    px = about.features.get("image", (32,))[0]
    seen = Features(scan=SEEN.scan, image=SEEN.image[:px, :px].copy())
    driver = network if isinstance(network, DrivingNet) else network.driving()
    assert loaded.act(seen) == driver.act(seen)
    assert [entry.name for entry in path.parent.iterdir()] == ["one.safetensors"]


def test_an_expert_that_comes_with_the_project_is_written_as_it_was(tmp_path):
    shipped = shipped_path("camera", load_profile("thesis-sim"))
    copy = tmp_path / "copy.safetensors"
    save_checkpoint(copy, *load_checkpoint(shipped))
    assert copy.read_bytes() == shipped.read_bytes()


@pytest.mark.parametrize(
    ("network", "sizes"),
    [
        (camera_net(16, seed=1), {"bins": 130, "filters": 16}),
        (camera_net(8, px=24, seed=1), {"bins": 130, "filters": 8, "px": 24}),
        (lidar_net(101, seed=2), {"bins": 101, "filters": 16}),
        (fusion_net(101, 16, seed=3), {"bins": 101, "filters": 16}),
        (kernel_net(101, 16), {"bins": 101, "filters": 16, "px": 32, "examples": 0}),
    ],
)
def test_a_file_from_before_features_had_names_is_read(tmp_path, network, sizes):
    """Such a file had the sizes of both sensors, also of the one that its network does not see."""
    path = tmp_path / "old.safetensors"
    about = {"kind": network.kind, **sizes, "profile": "p", "cruise": None, "provenance": "", "seed": 0}
    save_file(network.weights(), path, {"lira": json.dumps(about)})
    loaded, found = load_checkpoint(path)
    assert found == Checkpoint.of(network, "p", "", 0)
    for name, value in network.weights().items():
        np.testing.assert_array_equal(loaded.weights()[name], value)


def test_a_missing_checkpoint_says_how_to_make_one(tmp_path):
    with pytest.raises(StorageError, match="there is no checkpoint") as refused:
        load_checkpoint(tmp_path / "none.safetensors")
    assert "train-expert" in refused.value.remedy


@pytest.mark.parametrize("keep", [0, 5, 100, 2000, 20000])
def test_a_truncated_checkpoint_is_refused(tmp_path, keep):
    path = tmp_path / "x.safetensors"
    save_checkpoint(path, lidar_net(101), checkpoint("lidar"))
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(StorageError, match="not a whole"):
        load_checkpoint(path)


def test_junk_and_a_folder_are_refused(tmp_path):
    path = tmp_path / "x.safetensors"
    path.write_bytes(b"\xff" * 5000)
    for bad in (path, tmp_path):
        with pytest.raises(StorageError):
            load_checkpoint(bad)


@pytest.mark.parametrize(
    "about",
    [
        {"kind": "lidar"},
        {"kind": "walrus"},
        {"kind": "camera"},
        {"features": {"image": [32, 32], "scan": [130]}},
        {"features": {"scan": [101], "image": [32, 32], "smell": [3]}},
        {"features": {"image": [32, 32]}},
        {"features": {}},
        {"features": {"image": [32, 32], "scan": [101, 1]}},
        {"features": {"image": [32], "scan": [101]}},
        {"features": {"image": [32, 31], "scan": [101]}},
        {"features": {"image": [32, 32], "scan": [0]}},
        {"features": {"image": [2, 2], "scan": [101]}},
        {"features": {"image": [100_000, 100_000], "scan": [101]}},
        {"features": {"image": [256, 256], "scan": [101]}},
        {"features": {"image": [256, 256], "scan": [4096]}, "filters": 512},
        {"filters": 32},
        {"filters": 10**9},
        {"filters": 0},
        {"filters": 512},
        {"seed": "x"},
        {"seed": -1},
        {"seed": 10**30},
        {"cruise": [1e308, 0.0]},
    ],
)
def test_a_checkpoint_that_is_not_what_it_says_is_refused(tmp_path, about):
    path = tmp_path / "x.safetensors"
    fields = {"kind": "fusion", "features": SHAPES, "filters": 16, "profile": "p", "cruise": None, "provenance": ""}
    fields |= {"seed": 0}
    save_file(fusion_net(101, 16).weights(), path, {"lira": json.dumps(fields)})
    load_checkpoint(path)
    save_file(fusion_net(101, 16).weights(), path, {"lira": json.dumps(fields | about)})
    with pytest.raises(StorageError, match="does not hold what it says"):
        load_checkpoint(path)


def test_what_is_no_file_and_what_is_nested_without_end_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zeros").symlink_to("/dev/zero")
    with (tmp_path / "huge").open("wb") as huge:
        huge.truncate(2**29)
    save_file(lidar_net(101).weights(), tmp_path / "nested", {"lira": "[" * 100_000})
    for name in ("pipe", "zeros", "huge", "nested"):
        with pytest.raises(StorageError):
            load_checkpoint(tmp_path / name)


def test_weights_from_elsewhere_and_weights_that_are_not_finite_are_refused(tmp_path):
    path = tmp_path / "x.safetensors"
    save_file(fusion_net(101, 16).weights(), path, {"format": "pt"})
    with pytest.raises(StorageError, match="no checkpoint of this project"):
        load_checkpoint(path)
    network = lidar_net(101)
    network.out.bias.data[0] = float("nan")
    save_checkpoint(path, network, checkpoint("lidar"))
    with pytest.raises(StorageError, match="not finite"):
        load_checkpoint(path)


def test_a_checkpoint_that_cannot_be_written_leaves_the_old_one(tmp_path):
    path = tmp_path / "x.safetensors"
    path.mkdir()
    with pytest.raises(StorageError, match="cannot write"):
        save_checkpoint(path, lidar_net(101), checkpoint("lidar"))
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.safetensors"]
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match="cannot write"):
        save_checkpoint(tmp_path / "file" / "y", lidar_net(101), checkpoint("lidar"))
