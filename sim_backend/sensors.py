"""What the twin's robot sees: camera and lidar over one scene, each captured anew only when its period has passed."""

import time
from typing import Literal

import numpy as np

from lira.hal.errors import ConfigError
from lira.hal.messages import CompressedImage, Image, LaserScan
from lira.hal.profile import Camera, RobotProfile
from lira.sim_backend.camera import SMALL_PX, PinholeCamera, add_noise, encode_jpeg
from lira.sim_backend.drive import Motion
from lira.sim_backend.layout import Layout
from lira.sim_backend.lidar import RayLidar
from lira.sim_backend.scene import Scene, quiet

ROUNDING_S = 1e-9
TRIAL_FRAMES = 3


Renderer = Literal["auto", "tiny", "egl"]


class Sensors:
    """Camera and lidar of a profile over a layout. Not thread-safe.

    Raises `ConfigError` if EGL is asked for and this machine has none.
    """

    def __init__(self, profile: RobotProfile, layout: Layout, renderer: Renderer, seed: int) -> None:
        self._profile = profile
        self._camera_rng, lidar_rng = (np.random.default_rng([seed, stream]) for stream in (1, 2))
        self._camera = open_camera(profile.camera, layout, renderer)
        self._scene = self._camera.scene
        self.renderer = "egl" if self._scene.egl else "tiny"
        self._lidar = RayLidar(profile.lidar, self._scene, lidar_rng)
        self.forget()

    def forget(self) -> None:
        """Whatever was captured belongs to another episode."""
        self._image: Image | CompressedImage | None = None
        self._scan: LaserScan | None = None

    def arrange(self, layout: Layout) -> None:
        """Move the boxes."""
        self._scene.arrange(layout)

    def image(self, motion: Motion, now_s: float) -> Image | CompressedImage:
        """Return the newest picture, encoded as the profile wants it to travel."""
        camera = self._profile.camera
        if self._image is None or now_s - self._image.stamp_s >= 1.0 / camera.rate_hz - ROUNDING_S:
            picture = self._camera.render(float(motion.x_m), float(motion.y_m), float(motion.yaw_rad))
            picture = add_noise(picture, camera.noise_gray, self._camera_rng)
            if camera.encoding == "jpeg":
                self._image = CompressedImage(now_s, encode_jpeg(picture))
            else:
                self._image = Image(now_s, np.repeat(picture[..., None], 3, axis=-1))
        return self._image

    def scan(self, motion: Motion, now_s: float) -> LaserScan:
        """Return the newest turn of the lidar."""
        if self._scan is None or now_s - self._scan.stamp_s >= 1.0 / self._profile.lidar.rate_hz - ROUNDING_S:
            self._scan = self._lidar.scan(float(motion.x_m), float(motion.y_m), float(motion.yaw_rad), now_s)
        return self._scan

    def close(self) -> None:
        """Let go of the scene. May be called twice."""
        self._scene.close()


def open_camera(camera: Camera, layout: Layout, renderer: Renderer) -> PinholeCamera:
    """Build the scene with the renderer asked for; "auto" tries both for a large picture and keeps the faster one."""
    if renderer == "tiny" or (renderer == "auto" and camera.width_px * camera.height_px <= SMALL_PX):
        return PinholeCamera(camera, Scene(layout))
    scene = Scene(layout, egl=True)
    if renderer == "egl" and not scene.egl:
        scene.close()
        raise ConfigError(
            "pybullet cannot draw with EGL on this machine",
            "Install an EGL driver (Debian: libegl1 and libgl1-mesa-dri), or use the renderer 'tiny'.",
        )
    chosen = PinholeCamera(camera, scene)
    chosen_s = frame_time_s(chosen)
    if renderer == "auto" and scene.egl:
        other = PinholeCamera(camera, Scene(layout))
        if frame_time_s(other) < chosen_s:
            chosen, other = other, chosen
        other.scene.close()
    return chosen


def frame_time_s(camera: PinholeCamera) -> float:
    """Return the best time of a few pictures; the first ones also make the driver say what it has to say."""
    times_s = []
    with quiet():
        for _ in range(TRIAL_FRAMES):
            began_s = time.perf_counter()
            camera.render(0.0, 0.0, 0.0)
            times_s.append(time.perf_counter() - began_s)
    return min(times_s)
