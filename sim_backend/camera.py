"""The camera: a pinhole with its own width and height of view, drawn by a scene.

Neither TinyRenderer nor the sketch blurs edges, so a small picture is drawn larger and averaged down.
"""

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import ByteArray, WordArray
from lira.hal.profile import Camera, Depth
from lira.sim_backend.scenes.base import Pose, Scene, View

# Up to this many pixels a picture is worth drawing larger.
SMALL_PX = 160 * 120
OVERSAMPLE_WIDE = 8
OVERSAMPLE_HIGH = 3
WORDS = 1 << 16


class PinholeCamera:
    """Shows what a camera on the robot sees in a scene."""

    def __init__(self, camera: Camera, scene: Scene) -> None:
        self.scene = scene
        self._size = (camera.width_px, camera.height_px)
        self._average = is_small(camera)
        wide, high = (OVERSAMPLE_WIDE, OVERSAMPLE_HIGH) if self._average else (1, 1)
        self.view = View(camera, camera.width_px * wide, camera.height_px * high)

    def render(self, pose: Pose) -> ByteArray:
        """Picture from a robot at this pose, gray like everything in a world: uint8 [height, width]."""
        picture = self.scene.photograph(self.view, pose)
        if self._average:
            picture = np.asarray(cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        return picture

    def depth(self, depth: Depth, pose: Pose) -> WordArray:
        """Distances along the optical axis from a robot at this pose: uint16 [height, width], millimetres, 0 for none.

        One pixel of the picture is taken for each, none are mixed: between two distances lies nothing.
        """
        rows, columns = _middles(depth.height_px, self.view.height_px), _middles(depth.width_px, self.view.width_px)
        along_m = self.scene.distances_m(self.view, pose, rows, columns)
        seen = (along_m >= depth.range_min_m) & (along_m <= depth.range_max_m)
        return np.where(seen, np.rint(along_m * 1000.0), 0.0).astype(np.uint16)


def is_small(camera: Camera) -> bool:
    """Tell whether its picture is averaged down from a larger one."""
    return camera.width_px * camera.height_px <= SMALL_PX


def _middles(count: int, size: int) -> NDArray[np.intp]:
    """Indices of the middles of `count` equal parts of `size` pixels."""
    return ((np.arange(count) + 0.5) * size / count).astype(np.intp)


def add_noise(picture: ByteArray, noise_gray: float, rng: np.random.Generator) -> ByteArray:
    """Add normal noise of a standard deviation in gray levels, rounded to whole ones."""
    if noise_gray == 0.0:
        return picture
    words = np.frombuffer(rng.bytes(2 * picture.size), np.uint16).reshape(picture.shape)
    return np.asarray(cv2.add(picture, noise_table(noise_gray)[words], dtype=cv2.CV_8U), dtype=np.uint8)


@lru_cache(maxsize=4)
def noise_table(noise_gray: float) -> NDArray[np.int16]:
    """Noise in whole gray levels by a random word of 16 bits: each level as often as a normal draw rounds to it.

    To draw a normal number for every pixel of a large picture takes longer than everything else.
    """
    levels = np.arange(-256, 257)
    below = [0.5 + 0.5 * math.erf((level + 0.5) / (noise_gray * math.sqrt(2.0))) for level in levels[:-1].tolist()]
    ends = np.rint(np.array([*below, 1.0]) * WORDS).astype(int)
    return np.repeat(levels, np.diff(ends, prepend=0)).astype(np.int16)
