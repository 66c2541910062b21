"""Drive a robot that runs ROS 2 and zenoh-bridge-ros2dds, with nothing of ours on it: serve it here like any other.

On the robot: zenoh-bridge-ros2dds. Here: this verb, and then lira fusion, lira joystick and lira console as always. The
governor (limits, time-outs, emergency stop, who may drive) works here. When this machine or the radio fails, only what
the robot's own ROS stack does stops it. robot/README.md says more.

examples:
  lira ros2 --connect rosbot:7447 --cmd-vel twist_stamped --lidar-yaw 180
  lira ros2 --connect rosbot:7447 --namespace robot1 --topic odom=odometry/filtered --topic cmd_vel=base/cmd_vel
  lira drive lidar-expert
"""

import argparse
import math
import sys
import threading
import time
from contextlib import closing
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.tools.options import add_profile, add_server

if TYPE_CHECKING:
    from lira.hal.bus.bus import Bus

LINK_S = 3.0
LOOK_S = 0.05
NOTHING_THERE = (
    "nothing of ours runs on this robot: if this machine, this program or the radio fails, only the robot's own "
    "controller stops it (look at its cmd_vel time-out, and try it with the wheels off the ground)"
)
NO_TIME = (
    "a Twist carries no time, so the robot cannot tell an old command: if its controller takes TwistStamped, "
    "say --cmd-vel twist_stamped"
)
ONE_LINK = (
    "there is one link to the bridge: after a gap of the radio TCP delivers what queued up, and the robot may obey it "
    "late (robot/README.md says how the bridge listens for datagrams, too)"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--connect", required=True, metavar="HOST:PORT", help="where the bridge listens")
    add("--namespace", default="", help="the bridge's namespace: what its keys begin with (default: none)")
    add(
        "--cmd-vel",
        choices=("twist", "twist_stamped"),
        default="twist",
        help="type of the robot's cmd_vel: newer controllers want TwistStamped (default: %(default)s)",
    )
    add(
        "--topic",
        action="append",
        default=[],
        metavar="NAME=ROS_TOPIC",
        help="another topic for scan, camera, odom, imu, battery or cmd_vel; may be given several times",
    )
    add("--lidar-yaw", type=float, default=0.0, metavar="DEG", help="how the lidar's frame is turned (ROSbot 2: 180)")
    add_profile(parser, "rosbot2")
    add_server(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until told to stop."""
    from lira.hal.bus.bus import Bus
    from lira.hal.profile import load_profile
    from lira.hal.server.serve import serve
    from lira.robot.ros2.robot import Interface, Ros2Robot
    from lira.tools.output.troubles import watch

    interface = Interface(topics(args.topic), args.cmd_vel == "twist_stamped", math.radians(args.lidar_yaw))
    profile = load_profile(args.profile)
    with closing(Bus(args.name, connect=args.connect, prefix=args.namespace.strip("/"))) as far:
        robot = Ros2Robot(profile, far, interface)

        def ready(_: Bus, stop: threading.Event) -> None:
            print(f"robot '{args.name}' (ROS 2 at {args.connect}) serves on {args.listen}", flush=True)
            for warning in warnings(far, stamped=interface.stamped):
                print(f"warning: {warning}", file=sys.stderr, flush=True)
            watch(robot, stop)

        serve(robot, args.name, args.listen, insecure=args.insecure, ready=ready)
    return 0


def topics(words: list[str]) -> dict[str, str]:
    """Read NAME=ROS_TOPIC. Raises `ConfigError`."""
    found = {}
    for word in words:
        name, equals, topic = word.partition("=")
        if not equals or not topic.strip("/"):
            raise ConfigError(f"--topic {word} names no topic", "Write for example --topic odom=odometry/filtered.")
        found[name] = topic
    return found


def warnings(far: "Bus", *, stamped: bool) -> list[str]:
    """What is missing beside a robot that runs our server."""
    from lira.hal.bus.bus import LINKS_PER_PEER

    until_s = time.monotonic() + LINK_S
    while far.links() < LINKS_PER_PEER and time.monotonic() < until_s:
        time.sleep(LOOK_S)
    found = [NOTHING_THERE]
    if not stamped:
        found.append(NO_TIME)
    if far.links() < LINKS_PER_PEER:
        found.append(ONE_LINK)
    return found
