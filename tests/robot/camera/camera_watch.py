"""A camera device on a source, and what it hands on."""

import time
from pathlib import Path

from lira.hal.messages import DepthImage
from lira.hal.profile import load_profile
from lira.robot.camera.device import CameraDevice
from lira.robot.supervisor import Supervisor

CAMERA = load_profile("rosbot2").camera
DEBIAN = sorted(Path("/usr/lib").glob("*/libOpenNI2.so.0"))
NO_OPENNI = "libopenni2-0 is not installed"


def grab_on(source):
    """Grab until the source raises."""
    while True:
        source.grab(0.05)


class Watch:
    """A camera device on a source."""

    def __init__(self, url, openni=None, depth=False, camera=CAMERA):
        self.pictures, self.depths = [], []
        self.device = CameraDevice(url, camera, self.put, openni, depth=depth)
        self.supervisor = Supervisor("camera", self.device.session)

    def __enter__(self):
        self.supervisor.start()
        return self

    def __exit__(self, *_):
        self.supervisor.close()

    def put(self, picture):
        (self.depths if isinstance(picture, DepthImage) else self.pictures).append(picture)

    def wait(self, count, timeout_s=6.0):
        until_s = time.monotonic() + timeout_s
        while len(self.pictures) < count:
            assert time.monotonic() < until_s, self.supervisor.failure
            time.sleep(0.01)
        return self.pictures[-1]
