"""How images are compressed before they travel."""

import cv2
import numpy as np
import pytest

from lira.hal.errors import SensorError
from lira.hal.messages import CompressedImage, DepthImage, Image
from lira.hal.messages.compression import PICTURE_LIMIT_BYTES, compress, compress_depth, read_depth

RNG = np.random.default_rng(1)


def test_png_is_lossless_and_keeps_the_order_of_colours():
    pixels = RNG.integers(0, 256, (32, 32, 3), np.uint8)
    compressed = compress(Image(1.5, pixels), "png")
    assert (compressed.stamp_s, compressed.format) == (1.5, "png")
    back = cv2.imdecode(np.frombuffer(compressed.data, np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(back[..., ::-1], pixels)


def test_gray_travels_too():
    pixels = RNG.integers(0, 256, (8, 9), np.uint8)
    back = cv2.imdecode(
        np.frombuffer(compress(Image(1.0, pixels, "mono8"), "png").data, np.uint8), cv2.IMREAD_GRAYSCALE
    )
    assert np.array_equal(back, pixels)


def test_jpeg_keeps_below_the_limit_even_for_noise():
    compressed = compress(Image(1.0, np.full((480, 640, 3), 90, np.uint8)), "jpeg")
    assert compressed.format == "jpeg"
    noise = RNG.integers(0, 256, (240, 320, 3), np.uint8)
    assert len(compress(Image(1.0, noise), "jpeg").data) <= PICTURE_LIMIT_BYTES


def test_what_is_no_image_is_a_sensor_error():
    with pytest.raises(SensorError, match="shape"):
        compress(Image(1.0, np.zeros((0, 0, 3), np.uint8)), "jpeg")


def test_a_depth_image_fits_and_no_distance_stays_no_distance():
    noise = np.random.default_rng(0).integers(0, 8000, (480, 640)).astype(np.uint16)
    noise[::2, ::3] = 0
    sent = compress_depth(DepthImage(1.0, noise))
    assert len(sent.data) <= PICTURE_LIMIT_BYTES
    seen = cv2.imdecode(np.frombuffer(sent.data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert seen.dtype == np.uint16
    assert np.array_equal(seen, noise[:: 480 // seen.shape[0], :: 640 // seen.shape[1]])
    flat = DepthImage(1.0, np.full((480, 640), 1234, np.uint16))
    seen = read_depth(compress_depth(flat))
    assert seen.stamp_s == 1.0
    assert np.array_equal(seen.data, flat.data)
    assert read_depth(flat) is flat


@pytest.mark.parametrize("data", [b"", b"no picture", compress(Image(1.0, np.zeros((8, 8, 3), np.uint8)), "png").data])
def test_a_picture_without_distances_is_no_depth(data):
    with pytest.raises(SensorError, match="no depth"):
        read_depth(CompressedImage(1.0, data, "png"))


def test_half_a_depth_is_an_error():
    whole = compress_depth(DepthImage(1.0, np.zeros((8, 8), np.uint16)))
    with pytest.raises(SensorError):
        read_depth(CompressedImage(1.0, whole.data[:-20], "png"))
