"""Run the physical ROSbot 2.0, or a robot of your own: open it and serve it on the bus, driven exactly like the twin.

The wheels stand until everything works, and whenever a device is lost; it is opened again by itself. robot/README.md
says how to wire it and how to make the first drive.

examples:
  lira robot --lidar /dev/serial/by-id/usb-Silicon_Labs_CP2102-if00-port0 --base /dev/ttyS1 --camera openni:
  lira robot --lidar socket://rosbot:4001 --base socket://rosbot:4002 --camera http://rosbot:8080/stream
  lira robot --lidar /dev/ttyUSB0 --base /dev/ttyS1 --without camera
  lira robot --driver mylab.rover:Rover --profile my-rover.toml     a robot of your own
  lira robot ... --ros2            offered to ROS 2 (rmw_zenoh), too: topics, transforms, commands
  lira twin --wire /tmp/wire       devices to try it on: it prints the words for this verb
"""

import argparse
import threading
from pathlib import Path
from typing import TYPE_CHECKING, cast

from lira.hal.errors import ConfigError, PluginError
from lira.tools.options import add_profile, add_server
from lira.tools.output.troubles import watch
from lira.tools.ros2.graph import add_graph, offered

if TYPE_CHECKING:
    from lira.hal.bus.bus import Bus
    from lira.hal.port import Robot
    from lira.hal.profile import RobotProfile

ROBOT_HAS = ("profile", "open", "read", "drive", "now", "wait", "close")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--base", metavar="URL", help="CORE2 board: a serial port, or socket://host:port")
    add("--lidar", metavar="URL", help="RPLIDAR A2: likewise")
    add(
        "--camera",
        metavar="URL",
        help="openni: (Astra), /dev/video0 (UVC), http://... (MJPEG), rtsp://..., a video or a folder of images",
    )
    add(
        "--without",
        choices=("lidar", "camera"),
        action="append",
        default=[],
        help="drive without this device; may be given twice",
    )
    add(
        "--driver",
        metavar="MODULE:OBJECT",
        help="instead of a ROSbot's devices, a robot of your own: a class that is made from a profile",
    )
    add_profile(parser, "rosbot2")
    add("--settings", type=Path, metavar="FILE", help="how this robot is mounted and calibrated (.toml)")
    add("--openni", type=Path, metavar="DIR", help="folder of OpenNI2's library (default: OPENNI2_REDIST)")
    add_server(parser)
    add_graph(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until told to stop."""
    from lira.hal.profile import load_profile
    from lira.hal.server.serve import serve
    from lira.robot.settings import load_camera_info
    from lira.tools.launch.notify import Notifier

    check_devices(args)
    calibration = None if args.driver else load_camera_info(args.settings, load_profile(args.profile).camera)
    notifier = Notifier.from_environment()
    robot = open_own(args) if args.driver is not None else open_rosbot(args, load_profile(args.profile))

    def ready(_: "Bus", stop: threading.Event) -> None:
        blind = "".join(f", without {device}" for device in args.without)
        where = f"({robot.profile.name}) on {args.listen}{blind}"
        words = f"robot '{args.name}' serves {where}"
        print(f"{words}; stop with Ctrl-C", flush=True)
        notifier.ready(words)
        watch(robot, stop)

    with offered(args):
        serve(
            robot,
            args.name,
            args.listen,
            calibration=calibration,
            insecure=args.insecure,
            ready=ready,
            alive=notifier.alive,
        )
    return 0


def check_devices(args: argparse.Namespace) -> None:
    """Refuse what does not go together. Raises `ConfigError`."""
    if args.driver is not None:
        ours = [name for name in ("base", "lidar", "camera", "without", "settings", "openni") if getattr(args, name)]
        if ours:
            what = f"--{ours[0]} is the ROSbot's, and --driver brings its own"
            raise ConfigError(what, f"Leave out --{ours[0]}, or give it to your driver in another way.")
        return
    if args.base is None:
        raise ConfigError("no --base", "Give the URL of its CORE2 board, or a robot of your own with --driver.")
    for device in ("lidar", "camera"):
        given, refused = getattr(args, device) is not None, device in args.without
        if given == refused:
            what = f"both --{device} and --without {device}" if given else f"no --{device}"
            raise ConfigError(what, f"Give its URL, or say --without {device} to drive without it.")


def open_rosbot(args: argparse.Namespace, profile: "RobotProfile") -> "Robot":
    """Return the ROSbot at these URLs."""
    from lira.robot.rosbot import Devices, Rosbot
    from lira.robot.settings import load_settings

    return Rosbot(profile, Devices(args.base, args.lidar, args.camera, args.openni, load_settings(args.settings)))


def open_own(args: argparse.Namespace) -> "Robot":
    """Return a robot of the user's own, made from its profile. Raises `ConfigError` or `PluginError`."""
    from lira.hal.plugins import ROBOTS
    from lira.hal.profile import load_profile

    driver = ROBOTS.find(args.driver, {})
    if not callable(driver):
        what = f"the robot '{args.driver}' is a {type(driver).__name__}"
        raise ConfigError(what, "Give a class that is made from a profile, and then is a lira.Robot.")
    robot = driver(load_profile(args.profile))
    lacks = [name for name in ROBOT_HAS if not hasattr(robot, name)]
    if lacks:
        what = f"the robot '{args.driver}' has no {', '.join(lacks)}"
        raise PluginError(what, f"A lira.Robot has: {', '.join(ROBOT_HAS)}.")
    return cast("Robot", robot)
