"""What the twin's robot senses of its scene, each sensor captured anew only when its period has passed."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np

from lira.hal.bus.sensors import SENSORS, Stamped
from lira.hal.bus.topics import BATTERY
from lira.hal.messages import CompressedImage, DepthImage, Image
from lira.hal.messages.compression import fit_jpeg
from lira.hal.profile import RobotProfile
from lira.sim_backend.camera import PinholeCamera, add_noise
from lira.sim_backend.drive import Motion
from lira.sim_backend.layout import Layout
from lira.sim_backend.lidar import RayLidar
from lira.sim_backend.onboard import Accelerometer, read_battery, read_ranger
from lira.sim_backend.scenes.base import Pose
from lira.sim_backend.scenes.opening import Renderer, open_scene

ROUNDING_S = 1e-9
LASTING = {sensor.name for sensor in SENSORS if sensor.lasting}


@dataclass(frozen=True, slots=True)
class Device:
    """One sensor: how often it measures, and what of a robot that moves like this, now."""

    rate_hz: float
    measure: Callable[[Motion, float], Stamped]


class Sensors:
    """The sensors of a profile over a layout, but for the wheels' encoders. Not thread-safe.

    Raises `ConfigError` if EGL is asked for and this machine has none.
    """

    def __init__(self, profile: RobotProfile, layout: Layout, renderer: Renderer, seed: int) -> None:
        self._camera_rng, self._lidar_rng, self._imu_rng = (
            np.random.default_rng([seed, stream]) for stream in (1, 2, 3)
        )
        self._scene = open_scene(profile.camera, layout, renderer)
        self.drawer = self._scene.drawer
        self._mount(profile)
        self._newest: dict[str, Stamped] = {}

    def _mount(self, profile: RobotProfile) -> None:
        """Put the profile's sensors onto the robot."""
        self._profile = profile
        self._camera = PinholeCamera(profile.camera, self._scene)
        self._devices = self._build(profile)

    def _build(self, profile: RobotProfile) -> dict[str, Device]:
        """What the profile has, by the names in the table of sensors."""
        lidar, depth, battery = RayLidar(profile.lidar, self._scene, self._lidar_rng), profile.depth, profile.battery
        devices = {
            "camera": Device(profile.camera.rate_hz, self._photograph),
            "scan": Device(profile.lidar.rate_hz, lambda motion, now_s: lidar.scan(_pose(motion), now_s)),
        }
        if depth is not None:
            devices["depth"] = Device(
                depth.rate_hz, lambda motion, now_s: DepthImage(now_s, self._camera.depth(depth, _pose(motion)))
            )
        if profile.imu is not None:
            devices["imu"] = Device(profile.imu.rate_hz, Accelerometer(profile.imu, self._imu_rng).read)
        if battery is not None:
            devices["battery"] = Device(BATTERY.rate_hz, lambda _, now_s: read_battery(battery, now_s))
        for ranger in profile.ranger:
            devices[ranger.frame_id] = Device(ranger.rate_hz, partial(read_ranger, ranger, self._scene.ranges_m))
        return devices

    def forget(self) -> None:
        """Whatever was captured belongs to another episode, but for what outlives it."""
        self._newest = {name: value for name, value in self._newest.items() if name in LASTING}

    def arrange(self, layout: Layout, profile: RobotProfile) -> None:
        """Move the boxes; with another profile, whose sensors differ in how they are mounted and how well they measure,
        these are there from now on.
        """
        self._scene.arrange(layout)
        if profile != self._profile:
            self._mount(profile)

    def newest(self, motion: Motion, now_s: float) -> dict[str, Stamped]:
        """Return the newest of every sensor, by its name; measures anew what is due."""
        for name in self._devices:
            self.read(name, motion, now_s)
        return dict(self._newest)

    def read(self, name: str, motion: Motion, now_s: float) -> Any:
        """Return the newest of one sensor, measured anew if that is due. Raises `KeyError` if it is not there."""
        device, last = self._devices[name], self._newest.get(name)
        if last is None or now_s - last.stamp_s >= 1.0 / device.rate_hz - ROUNDING_S:
            self._newest[name] = device.measure(motion, now_s)
        return self._newest[name]

    def _photograph(self, motion: Motion, now_s: float) -> Image | CompressedImage:
        """A picture, encoded as the profile wants it to travel."""
        camera = self._profile.camera
        picture = add_noise(self._camera.render(_pose(motion)), camera.noise_gray, self._camera_rng)
        colours = np.asarray(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
        if camera.encoding == "jpeg":
            return CompressedImage(now_s, fit_jpeg(colours))
        return Image(now_s, colours)

    def close(self) -> None:
        """Let go of the scene. May be called twice."""
        self._scene.close()


def _pose(motion: Motion) -> Pose:
    return Pose(float(motion.x_m), float(motion.y_m), float(motion.yaw_rad))
