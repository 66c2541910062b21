"""From the camera's JPEG of 640x480 to 32x32 gray, beside decoding it whole and resizing; and the rest of the way."""

import math
import statistics
import time
from collections.abc import Callable

import cv2
import numpy as np

from lira.fusion.modalities.image import gray_image
from lira.fusion.modalities.scan import bin_scan
from lira.hal.messages import CompressedImage, FloatArray, Image, LaserScan
from lira.hal.profile import load_profile
from lira.tools.bench import Row

RUNS = 7
REPEATS = 50
PX = 32


def run() -> list[Row]:
    """Return one row per step of preprocessing; `speedup` where there is a plain way to compare with."""
    rng = np.random.default_rng(0)
    photo = cv2.resize(rng.integers(60, 196, (48, 64, 3), dtype=np.uint8), (640, 480), interpolation=cv2.INTER_CUBIC)
    jpeg = CompressedImage(0.0, cv2.imencode(".jpg", photo)[1].tobytes())
    small = Image(0.0, np.ascontiguousarray(photo[:PX, :PX, 0]), "mono8")
    real = load_profile("rosbot2").features
    turn = LaserScan(0.0, 0.0, 2 * math.pi / 400, 0.15, 12.0, rng.uniform(0.2, 6.0, 400).astype(np.float32))
    turn.ranges[::50] = math.nan

    ours_s, plain_s = alternate(lambda: gray_image(jpeg, PX), lambda: decode_whole(jpeg))
    small_s, scan_s = alternate(lambda: gray_image(small, PX), lambda: bin_scan(turn, real))
    return [
        {"input": "jpeg 640x480", "ms": 1e3 * ours_s, "reference_ms": 1e3 * plain_s, "speedup": plain_s / ours_s},
        {"input": "mono8 32x32", "ms": 1e3 * small_s},
        {"input": "scan of 400 beams", "ms": 1e3 * scan_s},
    ]


def decode_whole(image: CompressedImage) -> FloatArray:
    """The plain way: decode all pixels in colour, then gray, then resize."""
    color = np.asarray(cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR))
    gray = cv2.cvtColor(color, cv2.COLOR_BGR2GRAY)
    return cv2.resize(gray, (PX, PX), interpolation=cv2.INTER_AREA).astype(np.float32) / np.float32(255)


def alternate(first: Callable[[], object], second: Callable[[], object]) -> tuple[float, float]:
    """Seconds per call of each: the median over runs that take turns, so that both meet the same noise."""
    runs = [(seconds_per_call(first), seconds_per_call(second)) for _ in range(RUNS)]
    return statistics.median(one for one, _ in runs), statistics.median(other for _, other in runs)


def seconds_per_call(function: Callable[[], object]) -> float:
    """Mean over some calls."""
    began = time.perf_counter()
    for _ in range(REPEATS):
        function()
    return (time.perf_counter() - began) / REPEATS
