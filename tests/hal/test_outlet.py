"""How images are compressed before they travel."""

import cv2
import numpy as np
import pytest

from hal.errors import SensorError
from hal.messages import Image
from hal.outlet import IMAGE_LIMIT_BYTES, compress

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
    assert len(compress(Image(1.0, noise), "jpeg").data) <= IMAGE_LIMIT_BYTES


def test_what_is_no_image_is_a_sensor_error():
    with pytest.raises(SensorError, match="shape"):
        compress(Image(1.0, np.zeros((0, 0, 3), np.uint8)), "jpeg")
