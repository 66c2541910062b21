"""The camera: a pinhole with its own width and height of view, rendered by pybullet.

TinyRenderer runs on any machine but does not anti-alias, so a small picture is rendered larger and averaged down.
The EGL plugin draws large pictures with OpenGL, which is faster where the machine has a graphics card.
"""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import ByteArray, FloatArray, WordArray
from lira.hal.profile import Camera, Depth
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scene import Scene

NEAR_M = 0.02
FAR_M = 60.0
# Up to this many pixels TinyRenderer wins, and its picture is worth rendering larger.
SMALL_PX = 160 * 120
OVERSAMPLE_WIDE = 8
OVERSAMPLE_HIGH = 3


class PinholeCamera:
    """Renders what a camera on the robot sees in a scene, with OpenGL if the scene has it."""

    def __init__(self, camera: Camera, scene: Scene) -> None:
        self._camera = camera
        self.scene = scene
        self._average = camera.width_px * camera.height_px <= SMALL_PX
        wide, high = (OVERSAMPLE_WIDE, OVERSAMPLE_HIGH) if self._average else (1, 1)
        width_px, height_px = camera.width_px * wide, camera.height_px * high
        self._background = background(camera, width_px, height_px, scene)
        # TinyRenderer samples each pixel at its corner instead of its middle, OpenGL does not.
        shift = (0.0, 0.0) if scene.egl else (1 / width_px, 1 / height_px)
        bullet = scene.bullet
        self._how = {
            "width": width_px,
            "height": height_px,
            "projectionMatrix": projection_matrix(camera, shift),
            "shadow": 0,
            "lightAmbientCoeff": 1.0,
            "lightDiffuseCoeff": 0.0,
            "lightSpecularCoeff": 0.0,
            "lightDirection": [0.0, 0.0, 1.0],
            "flags": bullet.ER_NO_SEGMENTATION_MASK,
            "renderer": bullet.ER_BULLET_HARDWARE_OPENGL if scene.egl else bullet.ER_TINY_RENDERER,
            "physicsClientId": scene.client,
        }

    def request(self, x_m: float, y_m: float, yaw_rad: float) -> dict[str, object]:
        """Return the arguments of pybullet's `getCameraImage` from a robot at this pose."""
        return {**self._how, "viewMatrix": view_matrix(self._camera, x_m, y_m, yaw_rad)}

    def render(self, x_m: float, y_m: float, yaw_rad: float) -> ByteArray:
        """Picture from a robot at this pose, gray like everything in a world: uint8 [height, width]."""
        pixels, depth = self.scene.photograph(self.request(x_m, y_m, yaw_rad))
        picture: ByteArray = np.where(depth < 1.0, pixels[..., 0], self._background)
        if self._average:
            size = (self._camera.width_px, self._camera.height_px)
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        return picture

    def depth(self, depth: Depth, x_m: float, y_m: float, yaw_rad: float) -> WordArray:
        """Distances along the optical axis from a robot at this pose: uint16 [height, width], millimetres, 0 for none.

        One pixel of the picture is taken for each, none are mixed: between two distances lies nothing.
        """
        _, buffer = self.scene.photograph(self.request(x_m, y_m, yaw_rad))
        rows = _middles(depth.height_px, buffer.shape[0])
        along_m = axis_distance_m(buffer[rows][:, _middles(depth.width_px, buffer.shape[1])])
        along_m = np.minimum(along_m, floor_distance_m(self._camera, buffer.shape[0])[rows, None])
        seen = (along_m >= depth.range_min_m) & (along_m <= depth.range_max_m)
        return np.where(seen, np.rint(along_m * 1000.0), 0.0).astype(np.uint16)


def _middles(count: int, size: int) -> NDArray[np.intp]:
    """Indices of the middles of `count` equal parts of `size` pixels."""
    return ((np.arange(count) + 0.5) * size / count).astype(np.intp)


def axis_distance_m(buffer: FloatArray) -> Floats:
    """Distances along the optical axis from OpenGL's depth buffer; infinite where nothing was drawn."""
    near, far = NEAR_M, FAR_M
    distance_m: Floats = far * near / (far - (far - near) * buffer.astype(np.float64))
    return np.where(buffer < 1.0, distance_m, np.inf)


def floor_distance_m(camera: Camera, height_px: int) -> Floats:
    """Distance along the optical axis at which each row meets the floor [height]; infinite above the horizon.

    The floor is not drawn, see `background`.
    """
    up = (1.0 - (2.0 * np.arange(height_px) + 1.0) / height_px) * math.tan(camera.vfov_rad / 2)
    falls = math.sin(camera.pitch_rad) - up * math.cos(camera.pitch_rad)  # per metre along the axis
    with np.errstate(divide="ignore"):
        return np.where(falls > 0.0, camera.z_m / falls, np.inf)


def background(camera: Camera, width_px: int, height_px: int, scene: Scene) -> ByteArray:
    """What is seen where nothing was drawn, uint8 [height, width]: sky, and floor below the horizon.

    The floor is flat and has no end, and the camera does not roll, so this is exact; drawing it would take
    TinyRenderer longer than everything that stands on it.
    """
    up = 1.0 - (2.0 * np.arange(height_px) + 1.0) / height_px
    sky = up * math.tan(camera.vfov_rad / 2) > math.tan(camera.pitch_rad)
    column = np.where(sky, scene.sky_gray, scene.ground_gray).astype(np.uint8)
    return np.repeat(column[:, None], width_px, axis=1)


def projection_matrix(camera: Camera, shift: tuple[float, float] = (0.0, 0.0)) -> list[float]:
    """OpenGL projection, column by column. The two angles may belong to pixels that are not square.

    `shift` moves the picture, in halves of its width and height.
    """
    wide, high = math.tan(camera.hfov_rad / 2), math.tan(camera.vfov_rad / 2)
    depth = FAR_M - NEAR_M
    return [
        *(1 / wide, 0.0, 0.0, 0.0),
        *(0.0, 1 / high, 0.0, 0.0),
        *(*shift, -(FAR_M + NEAR_M) / depth, -1.0),
        *(0.0, 0.0, -2 * FAR_M * NEAR_M / depth, 0.0),
    ]


def view_matrix(camera: Camera, x_m: float, y_m: float, yaw_rad: float) -> list[float]:
    """OpenGL view, column by column, of the camera on a robot at this pose."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    down, level = math.sin(camera.pitch_rad), math.cos(camera.pitch_rad)
    eye_x, eye_y, eye_z = x_m + camera.x_m * cos, y_m + camera.x_m * sin, camera.z_m
    forward = cos * eye_x + sin * eye_y
    return [
        *(sin, cos * down, -cos * level, 0.0),
        *(-cos, sin * down, -sin * level, 0.0),
        *(0.0, level, down, 0.0),
        *(cos * eye_y - sin * eye_x, -down * forward - level * eye_z, level * forward - down * eye_z, 1.0),
    ]


def add_noise(picture: ByteArray, noise_gray: float, rng: np.random.Generator) -> ByteArray:
    """Add normal noise of a standard deviation in gray levels."""
    if noise_gray == 0.0:
        return picture
    noise = rng.standard_normal(picture.shape, dtype=np.float32) * noise_gray
    noisy: ByteArray = np.clip(np.rint(picture + noise), 0, 255).astype(np.uint8)
    return noisy
