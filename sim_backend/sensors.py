"""What the twin's robot senses of its scene, each sensor captured anew only when its period has passed."""

import time
from typing import Any, Literal

import numpy as np

from lira.hal.bus.topics import BATTERY
from lira.hal.errors import ConfigError
from lira.hal.messages import BatteryState, CompressedImage, DepthImage, Image, Imu, LaserScan, Range
from lira.hal.profile import Camera, RobotProfile
from lira.sim_backend.camera import SMALL_PX, PinholeCamera, add_noise, encode_jpeg
from lira.sim_backend.drive import Motion
from lira.sim_backend.layout import Layout
from lira.sim_backend.lidar import RayLidar
from lira.sim_backend.onboard import Accelerometer, read_battery, read_rangers
from lira.sim_backend.scene import Scene, quiet

ROUNDING_S = 1e-9
TRIAL_FRAMES = 3


Renderer = Literal["auto", "tiny", "egl"]


class Sensors:
    """The sensors of a profile over a layout, but for the wheels' encoders. Not thread-safe.

    Raises `ConfigError` if EGL is asked for and this machine has none.
    """

    def __init__(self, profile: RobotProfile, layout: Layout, renderer: Renderer, seed: int) -> None:
        self._profile = profile
        self._camera_rng, lidar_rng, imu_rng = (np.random.default_rng([seed, stream]) for stream in (1, 2, 3))
        self._camera = open_camera(profile.camera, layout, renderer)
        self._scene = self._camera.scene
        self.renderer = "egl" if self._scene.egl else "tiny"
        self._lidar = RayLidar(profile.lidar, self._scene, lidar_rng)
        self._imu = None if profile.imu is None else Accelerometer(profile.imu, imu_rng)
        self._battery: BatteryState | None = None
        self.forget()

    def forget(self) -> None:
        """Whatever was captured belongs to another episode; but for the battery."""
        self._image: Image | CompressedImage | None = None
        self._scan: LaserScan | None = None
        self._depth: DepthImage | None = None
        self._felt: Imu | None = None
        self._near: tuple[Range, ...] = ()

    def arrange(self, layout: Layout) -> None:
        """Move the boxes."""
        self._scene.arrange(layout)

    def observe(self, motion: Motion, now_s: float) -> dict[str, Any]:
        """Return the newest of every sensor that the profile has, by its field of an `Observation`."""
        return {
            "image": self.image(motion, now_s),
            "scan": self.scan(motion, now_s),
            "depth": self.depth(motion, now_s),
            "imu": self.imu(motion, now_s),
            "ranges": self.ranges(motion, now_s),
            "battery": self.battery(now_s),
        }

    def image(self, motion: Motion, now_s: float) -> Image | CompressedImage:
        """Return the newest picture, encoded as the profile wants it to travel."""
        camera = self._profile.camera
        if self._image is None or _is_due(self._image.stamp_s, camera.rate_hz, now_s):
            picture = self._camera.render(*_pose(motion))
            picture = add_noise(picture, camera.noise_gray, self._camera_rng)
            if camera.encoding == "jpeg":
                self._image = CompressedImage(now_s, encode_jpeg(picture))
            else:
                self._image = Image(now_s, np.repeat(picture[..., None], 3, axis=-1))
        return self._image

    def scan(self, motion: Motion, now_s: float) -> LaserScan:
        """Return the newest turn of the lidar."""
        if self._scan is None or _is_due(self._scan.stamp_s, self._profile.lidar.rate_hz, now_s):
            self._scan = self._lidar.scan(*_pose(motion), now_s)
        return self._scan

    def depth(self, motion: Motion, now_s: float) -> DepthImage | None:
        """Return the newest picture of distances, if the camera measures them."""
        depth = self._profile.depth
        if depth is not None and (self._depth is None or _is_due(self._depth.stamp_s, depth.rate_hz, now_s)):
            self._depth = DepthImage(now_s, self._camera.depth(depth, *_pose(motion)))
        return self._depth

    def imu(self, motion: Motion, now_s: float) -> Imu | None:
        """Return the newest reading of the IMU."""
        imu = self._imu
        if imu is not None and (self._felt is None or _is_due(self._felt.stamp_s, imu.rate_hz, now_s)):
            self._felt = imu.read(motion, now_s)
        return self._felt

    def ranges(self, motion: Motion, now_s: float) -> tuple[Range, ...]:
        """Return the newest readings of the rangers; all are read at the rate of the first."""
        rangers = self._profile.ranger
        if rangers and (not self._near or _is_due(self._near[0].stamp_s, rangers[0].rate_hz, now_s)):
            self._near = read_rangers(rangers, self._scene.cast, motion, now_s)
        return self._near

    def battery(self, now_s: float) -> BatteryState | None:
        """Return the newest voltage."""
        battery = self._profile.battery
        if battery is not None and (self._battery is None or _is_due(self._battery.stamp_s, BATTERY.rate_hz, now_s)):
            self._battery = read_battery(battery, now_s)
        return self._battery

    def close(self) -> None:
        """Let go of the scene. May be called twice."""
        self._scene.close()


def _is_due(stamp_s: float, rate_hz: float, now_s: float) -> bool:
    return now_s - stamp_s >= 1.0 / rate_hz - ROUNDING_S


def _pose(motion: Motion) -> tuple[float, float, float]:
    return float(motion.x_m), float(motion.y_m), float(motion.yaw_rad)


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
