import math
import pickle
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lira.fusion.modalities.image import from_uint8, gray_image, to_uint8
from lira.fusion.modalities.scan import bin_scan
from lira.fusion.preprocess import Features, Preprocessor
from lira.hal.errors import SensorError
from lira.hal.messages import CompressedImage, Image, LaserScan, Observation
from lira.hal.profile import load_profile

SIM = load_profile("thesis-sim")
REAL = load_profile("rosbot2")
HALF = SIM.features.fov_rad / 2


def sim_scan(ranges) -> LaserScan:
    return LaserScan(0.0, -HALF, 2 * HALF / 100, 0.05, 4.0, np.asarray(ranges, np.float32))


def real_scan(distance, *, angle_min=0.0, beams=400, sign=1.0) -> LaserScan:
    """A full turn in which the beam at bearing b (in (-pi, pi]) reads distance(b)."""
    increment = sign * 2 * math.pi / beams
    bearings = np.remainder(angle_min + increment * np.arange(beams) + math.pi, 2 * math.pi) - math.pi
    ranges = np.array([distance(b) for b in bearings], np.float32)
    return LaserScan(0.0, angle_min, increment, 0.15, 12.0, ranges)


def photo(height=480, width=640) -> np.ndarray:
    y, x = np.mgrid[0:height, 0:width]
    red, green = 255 * x / width, 255 * y / height
    return np.stack([red, green, 128 + 60 * np.sin(x / 40)], axis=2).astype(np.uint8)


def jpeg(image=None) -> bytes:
    rgb = photo() if image is None else image
    return cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))[1].tobytes()


def test_the_simulated_scan_maps_one_to_one():
    ranges = np.linspace(0.1, 4.5, 101, dtype=np.float32)
    scan, invalid = bin_scan(sim_scan(ranges), SIM.features)
    np.testing.assert_allclose(scan, np.minimum(ranges / 4, 1))
    assert scan.dtype == np.float32
    assert invalid == 0


def test_angles_that_were_float32_on_the_bus_map_one_to_one_too():
    ranges = np.linspace(0.1, 3.9, 101, dtype=np.float32)
    scan = LaserScan(0.0, float(np.float32(-HALF)), float(np.float32(HALF / 50)), 0.05, 4.0, ranges)
    np.testing.assert_allclose(bin_scan(scan, SIM.features)[0], ranges / 4, rtol=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("angle_min", [0.0, -math.pi, math.pi, 1.0, 5.0])
def test_a_full_turn_is_cropped_to_ahead_whatever_its_first_angle(angle_min, sign):
    scan, invalid = bin_scan(real_scan(lambda b: 0.5 + b / 4, angle_min=angle_min, sign=sign), REAL.features)
    centres = np.radians(np.arange(130) - 64.5)
    np.testing.assert_allclose(scan, 0.5 + centres / 4, atol=0.5 / 4 * math.radians(2))
    assert invalid == 0


def test_the_nearest_return_of_a_bin_wins():
    fine = real_scan(lambda b: 0.2 if abs(b - math.radians(10.1)) < math.radians(0.06) else 0.9, beams=3600)
    scan, _ = bin_scan(fine, REAL.features)
    assert scan[75] == pytest.approx(0.2)
    assert np.all(np.delete(scan, 75) == pytest.approx(0.9))


def test_ranges_follow_rep_117():
    ranges = np.full(101, 2.0)
    ranges[[3, 4, 5, 6]] = [math.inf, -math.inf, 9.0, 4.0]
    scan, invalid = bin_scan(sim_scan(ranges), SIM.features)
    np.testing.assert_allclose(scan[2:8], [0.5, 1.0, 0.0, 1.0, 1.0, 0.5])
    assert invalid == 0


def test_invalid_beams_are_counted_and_take_the_nearest_neighbours_value():
    ranges = np.linspace(1.0, 3.0, 101)
    want = ranges / 4
    ranges[[0, 1, 50, 60, 61, 62, 100]] = math.nan
    want[[0, 1, 50, 60, 61, 62, 100]] = want[[2, 2, 49, 59, 59, 63, 99]]  # in the middle the nearer obstacle
    scan, invalid = bin_scan(sim_scan(ranges), SIM.features)
    np.testing.assert_allclose(scan, want, rtol=1e-6)
    assert invalid == 7


@pytest.mark.parametrize("zero", [0.0, -1.0])
def test_zero_is_not_a_distance(zero):
    ranges = np.full(101, 2.0)
    ranges[7] = zero
    scan, invalid = bin_scan(sim_scan(ranges), SIM.features)
    assert scan[7] == 0.5
    assert invalid == 1


def test_an_invalid_beam_does_not_hide_a_valid_one_in_its_bin():
    scan = real_scan(lambda _: 0.5, beams=800)
    scan.ranges[::2] = math.nan
    got, invalid = bin_scan(scan, REAL.features)
    assert np.all(got == 0.5)
    assert 140 < invalid < 150


def test_half_of_the_bins_may_be_invalid_and_no_more():
    ranges = np.full(101, 2.0)
    ranges[:50] = math.nan
    assert np.all(bin_scan(sim_scan(ranges), SIM.features)[0] == 0.5)
    ranges[50] = math.nan
    with pytest.raises(SensorError, match="51 of 101 bins"):
        bin_scan(sim_scan(ranges), SIM.features)


@pytest.mark.parametrize("count", [0, 1, 50, 100])
def test_a_scan_that_is_too_short_is_refused_with_a_remedy(count):
    with pytest.raises(SensorError, match=r"wrong length") as refused:
        bin_scan(sim_scan(np.ones(count)), SIM.features)
    assert "profile" in refused.value.remedy


def test_a_scan_of_more_than_a_turn_is_refused():
    scan = real_scan(lambda _: 0.5)
    with pytest.raises(SensorError, match="wrong length"):
        bin_scan(replace(scan, ranges=np.ones(500, np.float32)), REAL.features)


@pytest.mark.parametrize(
    "bad",
    [{"angle_increment": 0.0}, {"angle_increment": math.nan}, {"angle_min": math.inf}, {"angle_increment": 1e300}],
)
def test_angles_that_make_no_sense_are_refused(bad):
    with pytest.raises(SensorError, match="make no sense"):
        bin_scan(replace(sim_scan(np.ones(101)), **bad), SIM.features)


def test_a_sector_that_looks_elsewhere_is_refused():
    with pytest.raises(SensorError, match="do not cover"):
        bin_scan(replace(sim_scan(np.ones(101)), angle_min=0.0), SIM.features)


@settings(deadline=None, max_examples=200)
@given(
    st.lists(st.floats(width=32), max_size=450),
    st.floats(),
    st.floats(-0.1, 0.1) | st.floats(),
    st.sampled_from([SIM.features, REAL.features]),
)
def test_any_scan_gives_features_in_range_or_a_sensor_error(ranges, angle_min, increment, shape):
    scan = LaserScan(0.0, angle_min, increment, 0.05, 4.0, np.array(ranges, np.float32))
    try:
        got, invalid = bin_scan(scan, shape)
    except SensorError:
        return
    assert got.shape == (shape.bins,)
    assert np.all((got >= 0) & (got <= 1))
    assert 0 <= invalid <= len(ranges)


def test_a_small_gray_image_passes_unchanged():
    gray = np.random.default_rng(1).integers(0, 256, (32, 32), dtype=np.uint8)
    image = gray_image(Image(0.0, gray, "mono8"), 32)
    assert image.dtype == np.float32
    np.testing.assert_array_equal(image, (gray / 255).astype(np.float32))
    np.testing.assert_array_equal(to_uint8(image), gray)


def test_every_gray_level_survives_there_and_back():
    levels = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(to_uint8(from_uint8(levels)), levels)


def test_gray_is_bt_601_averaged_over_areas():
    rgb = np.zeros((64, 64, 3), np.uint8)
    rgb[::2] = (200, 100, 50)
    expected = (0.299 * 200 + 0.587 * 100 + 0.114 * 50) / 2 / 255
    np.testing.assert_allclose(gray_image(Image(0.0, rgb), 32), expected, atol=1 / 255)


@pytest.mark.parametrize("size", [(480, 640), (240, 320), (96, 128), (32, 32), (20, 24)])
def test_a_jpeg_decoded_at_reduced_size_looks_like_the_full_one(size):
    rgb = photo(*size)
    full = gray_image(Image(0.0, rgb), 32)
    np.testing.assert_allclose(gray_image(CompressedImage(0.0, jpeg(rgb)), 32), full, atol=5 / 255)


def test_a_png_is_exact():
    gray = np.random.default_rng(2).integers(0, 256, (32, 32), dtype=np.uint8)
    data = cv2.imencode(".png", gray)[1].tobytes()
    np.testing.assert_array_equal(
        gray_image(CompressedImage(0.0, data, "png"), 32), gray_image(Image(0.0, gray, "mono8"), 32)
    )


@pytest.mark.parametrize("keep", [0.0, 0.001, 0.1, 0.5, 0.99])
@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_truncated_images_are_refused(keep, suffix):
    data = cv2.imencode(suffix, photo())[1].tobytes()
    with pytest.raises(SensorError) as refused:
        gray_image(CompressedImage(0.0, data[: int(keep * len(data))], suffix[1:]), 32)
    assert refused.value.remedy


def test_padding_behind_a_jpeg_is_no_truncation():
    assert gray_image(CompressedImage(0.0, jpeg() + bytes(100)), 32).shape == (32, 32)


def test_a_header_that_claims_a_gigantic_image_is_refused():
    data = bytearray(jpeg())
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = b"\xff\xff\xff\xff"
    with pytest.raises(SensorError, match="does not decode"):
        gray_image(CompressedImage(0.0, bytes(data)), 32)


@pytest.mark.parametrize(
    "image",
    [
        Image(0.0, np.zeros((4, 4), np.uint8), "rgb8"),
        Image(0.0, np.zeros((4, 4, 3), np.uint8), "mono8"),
        Image(0.0, np.zeros((0, 4, 3), np.uint8), "rgb8"),
        Image(0.0, np.zeros((4, 4), np.float32), "mono8"),  # type: ignore[arg-type]
        Image(0.0, np.zeros((4, 4), np.uint8), "16UC1"),
    ],
)
def test_raw_images_that_are_not_what_they_say_are_refused(image):
    with pytest.raises(SensorError, match="is not"):
        gray_image(image, 32)


@settings(deadline=None, max_examples=150)
@given(st.data())
def test_fuzzed_images_give_an_image_or_a_sensor_error(data):
    suffix = data.draw(st.sampled_from([".jpg", ".png"]))
    raw = bytearray(cv2.imencode(suffix, photo(96, 128))[1].tobytes())
    for _ in range(data.draw(st.integers(1, 8))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    try:
        image = gray_image(CompressedImage(0.0, bytes(raw)), 32)
    except SensorError:
        return
    assert image.shape == (32, 32)
    assert np.all((image >= 0) & (image <= 1))


@settings(deadline=None)
@given(st.binary(max_size=200), st.sampled_from([b"", b"\xff\xd8", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n"]))
def test_bytes_that_are_no_image_are_refused(junk, start):
    with pytest.raises(SensorError):
        gray_image(CompressedImage(0.0, start + junk), 32)


def observation(**sensors) -> Observation:
    defaults = {"scan": sim_scan(np.full(101, 2.0)), "image": Image(0.0, photo(32, 32))}
    return Observation(1, 0.0, **(defaults | sensors))


def test_the_preprocessor_gives_features():
    features = Preprocessor(SIM)(observation())
    assert features is not None
    assert features.scan.shape == (101,)
    assert features.image.shape == (32, 32)


def test_what_is_measured_when_somebody_looks_is_what_is_measured_at_once():
    there, looked = observation(), []
    seen = Preprocessor(SIM).looking(lambda field: looked.append(field) or getattr(there, field))
    whole = Preprocessor(SIM)(there)
    assert (list(seen), "image" in seen, "depth" in seen, looked) == (list(whole), True, False, [])
    np.testing.assert_array_equal(seen.scan, whole.scan)
    assert seen["scan"] is seen.scan
    assert looked == ["scan"]
    np.testing.assert_array_equal(seen.mirrored().image, whole.mirrored().image)
    assert isinstance(pickle.loads(pickle.dumps(seen)), Features)
    with pytest.raises(AttributeError, match="no 'depth', but image and scan"):
        _ = seen.depth


@pytest.mark.parametrize("absent", ["scan", "image"])
def test_without_a_sensor_there_are_no_features(absent):
    assert Preprocessor(SIM)(observation(**{absent: None})) is None


def test_the_preprocessor_counts_what_it_leaves_out():
    preprocess = Preprocessor(SIM)
    ranges = np.full(101, 2.0)
    ranges[:3] = math.nan
    preprocess(observation(scan=sim_scan(ranges)))
    preprocess(observation(scan=sim_scan(ranges)))
    for _ in range(2):
        with pytest.raises(SensorError):
            preprocess(observation(image=CompressedImage(0.0, jpeg()[:5000])))
    with pytest.raises(SensorError):
        preprocess(observation(scan=sim_scan(np.ones(7))))
    assert preprocess.invalid_beams == 6
    assert preprocess.refused == {"image truncated": 2, "scan length": 1}


def test_a_black_image_is_refused_and_a_dim_one_is_not():
    preprocess = Preprocessor(SIM)
    noise = np.random.default_rng(1).integers(0, 9, (48, 64, 3)).astype(np.uint8)
    with pytest.raises(SensorError, match="black"):
        preprocess(observation(image=Image(0.0, noise)))
    assert preprocess.refused == {"image black": 1}
    dim = noise.copy()
    dim[24:, 20:40] = 30
    assert preprocess(observation(image=Image(0.0, dim))) is not None
