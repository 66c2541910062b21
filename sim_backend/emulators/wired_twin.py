"""The twin behind the real wire protocols: whoever opens the devices in a folder drives the twin's robot."""

import math
import threading
import time
from pathlib import Path

import cv2
import numpy as np
from msgspec.structs import replace

from lira.hal.errors import DeviceError
from lira.hal.messages import Command, CompressedImage, CourseState, Episode, Image, LaserScan, Odometry, Twist
from lira.hal.profile import RobotProfile
from lira.sim_backend.emulators.camera import MjpegServer
from lira.sim_backend.emulators.core2 import Core2Unit, Firmware
from lira.sim_backend.emulators.regulators import PERIOD_S, Regulators
from lira.sim_backend.emulators.rplidar import RplidarUnit
from lira.sim_backend.emulators.rplidar_models import Model
from lira.sim_backend.emulators.wire import Wire
from lira.sim_backend.polyline import Floats
from lira.sim_backend.twin import Twin

LOOK_S = 0.01
OPEN_S = 30.0
RESET_S = 0.25  # two turns of the lidar and a bit
JOIN_S = 5.0
REACH_M = 12.0  # of an A2M8; a profile that sees less far is served as in a hall with walls at this distance
QUALITY = 95
DIRECTIONS = 181


class WiredTwin:
    """Opens a twin that runs in real time, and offers `folder/rplidar`, `folder/core2` and an MJPEG camera at `url`.

    Implements `hal.port.Arena`. Raises `DeviceError` where the folder does not take them.
    """

    def __init__(
        self, twin: Twin, folder: Path, lidar_model: Model | None = None, firmware: Firmware | None = None
    ) -> None:
        self.twin = twin
        self._scan: LaserScan | None = None
        self._odom = Odometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._shown: Image | CompressedImage | None = None
        self._failure: BaseException | None = None
        self._ready, self._stop = threading.Event(), threading.Event()
        # What opens the twin reads and closes it: its renderer may be bound to the thread.
        self._thread = threading.Thread(target=self._run, name="wired-twin", daemon=True)
        self.camera = MjpegServer()
        self.url = self.camera.url
        self._thread.start()
        self._ready.wait(OPEN_S)
        self._raise_failure()
        self.lidar = RplidarUnit(self._distances, lidar_model)
        self._regulators = Regulators(twin.profile.base)
        self.base = Core2Unit(self._drive, self._measure, firmware)
        self._wires: list[Wire] = []
        try:
            self._wires.append(Wire(folder / "rplidar", self.lidar))
            self._wires.append(Wire(folder / "core2", self.base))
        except DeviceError:
            self.close()
            raise
        self.lidar_wire, self.base_wire = self._wires

    def reset(self, episode: Episode) -> None:
        """Put the robot down anew, and wait until what its devices send belongs to the new episode."""
        self.twin.reset(episode)
        time.sleep(RESET_S)

    def state(self) -> CourseState:
        """Ground truth now."""
        return self.twin.state()

    def echo_share(self) -> float:
        """Share of the directions ahead, in the networks' field of view, from which the lidar gets an echo now."""
        half_rad = self.twin.profile.features.fov_rad / 2
        return float(np.count_nonzero(self._distances(np.linspace(-half_rad, half_rad, DIRECTIONS))) / DIRECTIONS)

    def close(self) -> None:
        """Unplug everything and close the twin. May be called twice."""
        for wire in self._wires:
            wire.close()
        self._stop.set()
        self._thread.join(JOIN_S)
        self.camera.close()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            self.camera.close()
            raise self._failure

    def _run(self) -> None:
        try:
            self.twin.open()
            try:
                self._look()
                self._ready.set()
                while not self._stop.wait(LOOK_S):
                    self._look()
            finally:
                self.twin.close()
        except BaseException as error:  # noqa: BLE001 - raised again by the thread that waits
            self._failure = error
        finally:
            self._ready.set()

    def _look(self) -> None:
        """Fetch what the sensors see."""
        seen = self.twin.read()
        if seen.image is not None and seen.image is not self._shown:
            self._shown = seen.image
            self.camera.show(jpeg_of(seen.image))
        self._scan = seen.scan
        self._odom = seen.odom or self._odom

    def _measure(self) -> Odometry:
        return self._regulators.reckon(self._odom)

    def _drive(self, twist: Twist) -> None:
        if self.twin.profile.base.drive == "wheels":
            twist = self._regulators.drive(twist, time.monotonic())
        self.twin.drive(Command(twist, self.twin.now()))

    def _distances(self, theta_rad: Floats) -> Floats:
        """What the laser meets at the unit's clockwise angles; 0 where nothing comes back.

        Zero says nothing to a driver, so a unit in the open would be as good as blind.
        """
        scan = self._scan
        if scan is None:
            return np.zeros(len(theta_rad))
        beams = len(scan.ranges)
        bearing_rad = np.remainder(-theta_rad + math.pi, math.tau) - math.pi
        index = np.rint((bearing_rad - scan.angle_min) / scan.angle_increment).astype(np.int64)
        if beams * scan.angle_increment > math.tau - 1e-3:
            index %= beams
        seen = (index >= 0) & (index < beams)
        ranges = np.where(seen, scan.ranges[np.clip(index, 0, beams - 1)], np.nan)
        if scan.range_max < REACH_M:
            ranges = np.where(np.isposinf(ranges), REACH_M, ranges)
        return np.where(np.isfinite(ranges), ranges, 0.0)


def sweeping(profile: RobotProfile) -> RobotProfile:
    """Return the profile for a twin behind wires.

    A head that turns sees now what the twin takes in whole turns, and its unit has blanks of its own. And wheels that
    swing about the fastest speed are now and then faster; who limits it is the robot's side.
    """
    base, swing_m_s = profile.base, 2 * profile.base.acceleration_m_s2 * PERIOD_S
    base = replace(
        base,
        max_linear_m_s=base.max_linear_m_s + swing_m_s,
        max_angular_rad_s=base.max_angular_rad_s + 2 * swing_m_s / base.track_m,
    )
    return replace(profile, base=base, lidar=replace(profile.lidar, rate_hz=1.0 / LOOK_S, dropout=0.0))


def jpeg_of(image: Image | CompressedImage) -> bytes:
    """Encode a picture of the twin as a network camera sends it."""
    if isinstance(image, CompressedImage):
        return image.data
    pixels = np.ascontiguousarray(image.data[..., ::-1])
    encoded: bytes = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
    return encoded
