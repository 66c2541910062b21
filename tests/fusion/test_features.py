"""Features are arrays by name, as many as the profile chooses; with the default they are what they always were."""

import pickle

import msgspec
import numpy as np
import pytest
from nets import noise

from lira.fusion.experts.load import load_policy
from lira.fusion.modalities.depth import near_depth
from lira.fusion.modalities.reading import ReadingError
from lira.fusion.preprocess import MODALITIES, Features, Preprocessor, modalities_of, shapes_of
from lira.hal.errors import ConfigError
from lira.hal.messages import CompressedImage, DepthImage, Image, LaserScan, Observation
from lira.hal.messages.compression import compress_depth
from lira.hal.profile import Depth, load_profile, profile_from_json

SIM = load_profile("thesis-sim")
LEVEL = 0.51 / 255  # as near as 8 bits come
DEPTH = Depth(width_px=64, height_px=96, range_min_m=0.05, range_max_m=8.0)


def learning_from(*inputs, depth=DEPTH):
    return msgspec.structs.replace(SIM, features=msgspec.structs.replace(SIM.features, inputs=inputs), depth=depth)


def observation(**changes):
    scan = LaserScan(0.0, -1.134464, 2.268928 / 100, 0.05, 4.0, np.full(101, 2.0, np.float32))
    pixels = np.full((32, 32, 3), 100, np.uint8)
    far = DepthImage(0.0, np.zeros((96, 64), np.uint16))
    return Observation(0, 0.0, **({"scan": scan, "image": Image(0.0, pixels), "depth": far} | changes))


def test_an_array_is_there_by_its_name():
    seen = Features(scan=np.ones(3, np.float32), depth=np.zeros((2, 2), np.float32))
    assert seen.scan is seen["scan"]
    assert list(seen) == ["scan", "depth"]
    assert "image" not in seen
    with pytest.raises(AttributeError, match=r"no 'image', but scan and depth"):
        _ = seen.image
    with pytest.raises(AttributeError):
        seen.scan = np.zeros(3, np.float32)


def test_they_travel_to_another_process():
    seen = noise(101)
    back = pickle.loads(pickle.dumps(seen))
    assert all(np.array_equal(back[name], seen[name]) for name in seen)


def test_in_a_mirror_every_array_is_reversed_across_what_is_seen():
    seen = Features(scan=np.arange(3, dtype=np.float32), depth=np.arange(4, dtype=np.float32).reshape(2, 2))
    other = seen.mirrored()
    assert other.scan.tolist() == [2, 1, 0]
    assert other.depth.tolist() == [[1, 0], [3, 2]]


def test_half_of_a_view_is_free_where_a_value_says_so():
    scan = np.linspace(0.1, 0.9, 5, dtype=np.float32)
    first, last = MODALITIES["scan"].halves(scan)
    assert first.tolist() == [1.0, 1.0, *scan[2:].tolist()]  # what is in the middle stays
    assert last.tolist() == [*scan[:3].tolist(), 1.0, 1.0]
    depth = np.zeros((6, 6), np.float32)
    assert [half.sum() for half in MODALITIES["depth"].halves(depth)] == [18.0, 18.0]
    assert MODALITIES["scan"].halves(np.ones(5, np.float32)) == ()  # nothing is in it
    assert MODALITIES["image"].halves(depth) == ()


class TestChoice:
    def test_by_default_a_robot_learns_from_image_and_scan(self):
        assert shapes_of(SIM) == {"image": (32, 32), "scan": (101,)}
        assert set(Preprocessor(SIM)(observation())) == {"image", "scan"}

    def test_the_profile_chooses_and_what_is_not_chosen_need_not_be_there(self):
        seen = Preprocessor(learning_from("depth", "scan"))(observation(image=None))
        assert {name: array.shape for name, array in seen.items()} == {"scan": (101,), "depth": (32, 32)}

    def test_the_order_is_the_tables_whatever_the_profiles(self):
        assert [row.name for row in modalities_of(learning_from("depth", "scan", "image"))] == list(MODALITIES)

    def test_a_sensor_that_is_silent_is_named(self):
        preprocess = Preprocessor(learning_from("image", "scan", "depth"))
        assert preprocess(observation(depth=None)) is None
        assert preprocess.silent(observation(depth=None, scan=None)) == ["lidar", "depth"]

    def test_a_name_that_is_none_and_a_sensor_that_is_not_there_are_refused(self):
        with pytest.raises(ConfigError, match=r"names 'smell'. Known: image, scan, depth"):
            Preprocessor(learning_from("scan", "smell"))
        with pytest.raises(ConfigError, match=r"no sensor for it.*\[depth\]"):
            Preprocessor(learning_from("scan", "depth", depth=None))

    @pytest.mark.parametrize("inputs", [[], ["scan", "scan"]])
    def test_none_and_one_twice_are_refused_with_the_profile(self, inputs):
        text = learning_from("scan").to_json().replace(b'["scan"]', msgspec.json.encode(inputs))
        with pytest.raises(ConfigError, match="inputs"):
            profile_from_json(text)


class TestDepth:
    def test_a_pixel_is_the_nearest_of_its_part_over_the_reach(self):
        data = np.full((96, 64), 3000, np.uint16)
        data[3, 5] = 1000  # of row 1, column 2
        seen = near_depth(DepthImage(0.0, data), 32, 4.0)
        assert seen.shape == (32, 32)
        assert seen[1, 2] == pytest.approx(0.25, abs=LEVEL)
        assert np.delete(seen.ravel(), 34) == pytest.approx(0.75, abs=LEVEL)

    def test_nothing_and_what_is_beyond_the_reach_are_free(self):
        data = np.zeros((96, 64), np.uint16)
        data[:48] = 5000
        assert (near_depth(DepthImage(0.0, data), 32, 4.0) == 1.0).all()

    def test_it_is_kept_in_8_bits_and_comes_back_exactly(self):
        rng = np.random.default_rng(0)
        seen = near_depth(DepthImage(0.0, rng.integers(0, 5000, (40, 50), dtype=np.uint16)), 32, 4.0)
        kept = MODALITIES["depth"].keep(seen)
        assert kept.dtype == np.uint8
        assert np.array_equal(MODALITIES["depth"].restore(kept), seen)

    def test_a_picture_smaller_than_the_feature_is_enlarged(self):
        data = np.array([[1000, 2000]], np.uint16)
        assert near_depth(DepthImage(0.0, data), 4, 4.0)[0] == pytest.approx([0.25, 0.25, 0.5, 0.5], abs=LEVEL)

    def test_as_it_travelled_it_is_the_same(self):
        depth = DepthImage(0.0, np.random.default_rng(1).integers(0, 5000, (96, 64), dtype=np.uint16))
        assert np.array_equal(near_depth(compress_depth(depth), 32, 4.0), near_depth(depth, 32, 4.0))

    @pytest.mark.parametrize(
        ("depth", "reason"),
        [
            (CompressedImage(0.0, b"no picture", "png"), "depth broken"),
            (DepthImage(0.0, np.zeros((3, 3, 3), np.uint16)), "depth shape"),
            (DepthImage(0.0, np.zeros((3, 3), np.float32)), "depth shape"),
            (DepthImage(0.0, np.zeros((0, 3), np.uint16)), "depth shape"),
        ],
    )
    def test_what_is_no_depth_is_refused_and_counted(self, depth, reason):
        preprocess = Preprocessor(learning_from("depth"))
        with pytest.raises(ReadingError):
            preprocess(observation(depth=depth))
        assert preprocess.refused == {reason: 1}


# What the experts that come with the project did when features were a scan and an image without names.
GOLDEN = {
    ("thesis-sim", "line", "camera"): (0.9893219, 0.2664712),
    ("thesis-sim", "line", "lidar"): (0.7936013, 0.3162026),
    ("thesis-sim", "passage", "camera"): (0.9996594, -0.5602454),
    ("thesis-sim", "passage", "lidar"): (0.7565150, 0.5647650),
    ("rosbot2", "corridor", "camera"): (0.9970541, 0.0690360),
    ("rosbot2", "garden", "lidar"): (0.9560637, 0.2530974),
}


@pytest.mark.parametrize(("profile", "task", "name"), GOLDEN)
def test_the_experts_act_as_they_always_did(profile, task, name):
    robot = load_profile(profile)
    expert = load_policy(f"{name}-expert", robot, task)
    assert expert.act(noise(robot.features.bins, 7)) == pytest.approx(GOLDEN[profile, task, name], abs=1e-5)
