"""A HAL server as a process, with no robot behind it: `python -m lira.tools.bench.parts.null_robot NAME HOST:PORT`."""

import sys
import time

import msgspec

from lira.hal.profile import RobotProfile, load_profile
from lira.hal.server.serve import serve
from lira.hal.testing import NullRobot

READY = "null robot serves"


def profile_at(scan_hz: float) -> RobotProfile:
    """The thesis's robot with a lidar of this rate."""
    profile = load_profile("thesis-sim")
    return msgspec.structs.replace(profile, lidar=msgspec.structs.replace(profile.lidar, rate_hz=scan_hz))


def main(name: str, endpoint: str, scan_hz: float) -> None:
    """Serve in real time until SIGTERM."""
    robot = NullRobot(profile_at(scan_hz), time.monotonic, time.sleep)
    serve(robot, name, endpoint, arena=robot, ready=lambda *_: print(f"{READY} {name}", flush=True))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]) if len(sys.argv) > 3 else 10.0)
