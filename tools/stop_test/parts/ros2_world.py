"""A robot that runs ROS 2, made up: what a bridge would show of it, and a controller with the usual time-out.

It hears and says plain CDR without attachments, and goes on whatever happens to `lira ros2`. The control message
`reset` puts it back to its start.

python -m lira.tools.stop_test.parts.ros2_world PROFILE JOURNAL CONTROL_PORT PORT
"""

import json
import math
import sys
import threading
import time
from pathlib import Path

import numpy as np
import zenoh

from lira.hal.bus.topics import CAMERA, CMD_VEL, ODOM, SCAN
from lira.hal.messages import STOP, Image, LaserScan, Odometry, Twist
from lira.hal.messages.compression import compress
from lira.hal.messages.ros.codec import decode, encode
from lira.hal.profile import RobotProfile, load_profile
from lira.hal.signals import stop_on_signal
from lira.hal.testing import small_pictures
from lira.tools.stop_test.control import listen
from lira.tools.stop_test.journal import JournalWriter, Truth, Wheels

READY = "a ROS 2 robot"
TIMEOUT_S = 0.5  # of its controller, after the last command
BEAT_S = 0.02
SENSOR_BEATS, SCAN_BEATS = 2, 4
BEAMS, FREE_M = 360, 5.0
CLOCK_S = 1.7e9  # a ROS clock is not this machine's monotonic one


class Ros2World:
    """Wheels that obey at once, in a wide room."""

    def __init__(self, profile: RobotProfile, journal: JournalWriter, session: zenoh.Session) -> None:
        self._profile, self._journal, self._session = profile, journal, session
        self._lock = threading.Lock()
        self._twist, self._until_s = STOP, -math.inf
        self._x_m = 0.0
        pixels = np.full((profile.camera.height_px, profile.camera.width_px, 3), 120, np.uint8)
        self._picture = Image(0.0, pixels)

    def hear(self, sample: zenoh.Sample) -> None:
        """Obey a command."""
        self._turn(decode(Twist, bytes(sample.payload)), time.monotonic() + TIMEOUT_S)

    def reset(self) -> None:
        """Go back to the start."""
        with self._lock:
            self._x_m = 0.0

    def run(self, stop: threading.Event) -> None:
        """Roll on, and show what is seen."""
        beats = 0
        while not stop.wait(BEAT_S):
            beats += 1
            now_s = time.monotonic()
            with self._lock:
                self._x_m += self._twist.linear_m_s * BEAT_S
                x_m, twist, late = self._x_m, self._twist, now_s >= self._until_s
            self._journal.note(Truth(now_s, x_m, 0.0, twist.linear_m_s))
            if late and twist != STOP:
                self._turn(STOP, math.inf)
            if beats % SENSOR_BEATS == 0:
                self._show(now_s + CLOCK_S, x_m, twist, scan=beats % SCAN_BEATS == 0)

    def _turn(self, twist: Twist, until_s: float) -> None:
        with self._lock:
            self._twist, self._until_s = twist, until_s
            self._journal.note(Wheels(time.monotonic(), twist.linear_m_s, twist.angular_rad_s))

    def _show(self, now_s: float, x_m: float, twist: Twist, *, scan: bool) -> None:
        camera, lidar = self._profile.camera, self._profile.lidar
        picture = compress(Image(now_s, self._picture.data), camera.encoding)
        odometry = Odometry(now_s, x_m, 0.0, 0.0, twist.linear_m_s, twist.angular_rad_s)
        shown = {ODOM.key: encode(odometry), CAMERA.key: encode(picture)}
        if scan:
            ranges = np.full(BEAMS, FREE_M, np.float32)
            limits = lidar.range_min_m, lidar.range_max_m
            shown[SCAN.key] = encode(LaserScan(now_s, -math.pi, math.tau / BEAMS, *limits, ranges))
        for key, payload in shown.items():
            self._session.put(key, payload)


def open_bridge(port: str) -> zenoh.Session:
    """Listen as zenoh-bridge-ros2dds does."""
    config = zenoh.Config()
    settings = {"mode": "router", "listen/endpoints": [f"tcp/127.0.0.1:{port}"], "scouting/multicast/enabled": False}
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def main(profile_name: str, journal_folder: str, control_port: int, port: str) -> None:
    """Be the robot until told to stop."""
    journal = JournalWriter(Path(journal_folder), "world")
    with open_bridge(port) as session:
        world = Ros2World(small_pictures(load_profile(profile_name)), journal, session)
        listen(control_port, lambda _: world.reset())
        with session.declare_subscriber(CMD_VEL.key, world.hear), stop_on_signal() as stop:
            print(READY, flush=True)
            world.run(stop)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4])
