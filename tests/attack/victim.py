"""A robot in a process of its own that notes when its base was told what: `victim.py KIND NAME ENDPOINT LOG [FAR]`.

The log has a line per order to the base: seconds on the monotonic clock, m/s, rad/s. FAR is a port for the far side of
`ros2`, a made-up robot behind a bridge.
"""

import signal
import sys
import time
from contextlib import ExitStack, closing
from pathlib import Path
from tempfile import TemporaryDirectory

from lira.hal.bus.bus import Bus
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.signals import stop_on_signal
from lira.hal.testing import NullRobot

PROFILE = load_profile("thesis-sim")
LIFE_S = 240


class Noted:
    """A robot whose orders to the base are written down."""

    def __init__(self, robot, log):
        self._robot = robot
        self._log = log

    def __getattr__(self, name):
        return getattr(self._robot, name)

    def drive(self, command):
        applied = self._robot.drive(command)
        got = applied.twist
        self._log.write(f"{time.monotonic()} {got.linear_m_s} {got.angular_rad_s}\n")
        return applied


def make(kind, far, stack):
    """Return a robot and its arena, which may be None."""
    if kind == "null":
        robot = NullRobot(PROFILE, time.monotonic, time.sleep)
        return robot, robot
    if kind == "lockstep":
        robot = NullRobot(PROFILE)
        return robot, robot
    if kind == "ros2":
        sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
        from ros2_peer import Peer

        from lira.robot.ros2.robot import Interface, Ros2Robot

        stack.enter_context(closing(Peer(far)))
        bus = stack.enter_context(closing(Bus("far", connect=f"127.0.0.1:{far}", prefix="")))
        return Ros2Robot(PROFILE, bus, Interface()), None
    from lira.sim_backend.twin import Twin

    twin = Twin(PROFILE, "line", realtime_factor=1.0)
    if kind == "twin":
        return twin, twin
    from lira.robot.rosbot import Devices, Rosbot
    from lira.robot.settings import BaseSettings, LidarSettings, Settings
    from lira.sim_backend.emulators.core2 import Firmware
    from lira.sim_backend.emulators.wired_twin import WiredTwin

    folder = Path(stack.enter_context(TemporaryDirectory()))
    wired = stack.enter_context(closing(WiredTwin(twin, folder, firmware=Firmware(boot_s=0.05))))
    settings = Settings(lidar=LidarSettings(spin_up_s=0.0), base=BaseSettings(boot_s=0.1))
    return Rosbot(PROFILE, Devices(str(folder / "core2"), str(folder / "rplidar"), wired.url, settings=settings)), None


def main(kind, name, endpoint, log, far="0"):
    with ExitStack() as stack:
        stop = stack.enter_context(stop_on_signal())
        bus = stack.enter_context(closing(Bus(name, listen=endpoint)))
        robot, arena = make(kind, int(far), stack)
        noted = Noted(robot, stack.enter_context(Path(log).open("w", buffering=1)))
        server = HalServer(
            GovernedRobot(noted), bus, arena, lockstep=kind == "lockstep", ready=lambda: print("serves", flush=True)
        )
        server.run(stop)


if __name__ == "__main__":
    signal.alarm(LIFE_S)  # whatever becomes of the test
    main(*sys.argv[1:])
