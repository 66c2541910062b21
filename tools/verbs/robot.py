"""Run the physical ROSbot 2.0: open its devices and serve it on the bus, driven exactly like the twin.

The wheels stand until everything works, and whenever a device is lost; it is opened again by itself. robot/README.md
says how to wire it and how to make the first drive.

examples:
  lira robot --lidar /dev/serial/by-id/usb-Silicon_Labs_CP2102-if00-port0 --base /dev/ttyS1 --camera openni:
  lira robot --lidar socket://rosbot:4001 --base socket://rosbot:4002 --camera http://rosbot:8080/stream
  lira robot --lidar /dev/ttyUSB0 --base /dev/ttyS1 --without camera
  lira twin --wire /tmp/wire       devices to try it on: it prints the words for this verb
"""

import argparse
import threading
from pathlib import Path
from typing import Protocol

from lira.hal.errors import ConfigError

LOOK_S = 0.2


class Troubled(Protocol):
    """A robot that says what is wrong with it."""

    def troubles(self) -> dict[str, str]:
        """What is lost, each with its remedy."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--base", required=True, metavar="URL", help="CORE2 board: a serial port, or socket://host:port")
    add("--lidar", metavar="URL", help="RPLIDAR A2: likewise")
    add(
        "--camera",
        metavar="URL",
        help="openni: (Astra), /dev/video0 (UVC), http://... (MJPEG), rtsp://..., or a folder of images",
    )
    add(
        "--without",
        choices=("lidar", "camera"),
        action="append",
        default=[],
        help="drive without this device; may be given twice",
    )
    add("--profile", default="rosbot2", help="robot by name or .toml file (default: %(default)s)")
    add("--settings", type=Path, metavar="FILE", help="how this robot is mounted and calibrated (.toml)")
    add("--openni", type=Path, metavar="DIR", help="folder of OpenNI2's library (default: OPENNI2_REDIST)")
    add("--name", default="rosbot", help="robot's name: every key on the bus begins with it (default: %(default)s)")
    add(
        "--listen",
        default="127.0.0.1:7447",
        metavar="HOST:PORT",
        help="where drivers connect; 0.0.0.0:7447 lets other machines in (default: %(default)s, this machine only)",
    )
    add("--insecure", action="store_true", help="let other machines in without keys (see lira keys)")


def run(args: argparse.Namespace) -> int:
    """Serve until told to stop."""
    for device in ("lidar", "camera"):
        given, refused = getattr(args, device) is not None, device in args.without
        if given == refused:
            what = f"both --{device} and --without {device}" if given else f"no --{device}"
            raise ConfigError(what, f"Give its URL, or say --without {device} to drive without it.")

    from lira.hal.profile import load_profile
    from lira.robot.settings import load_settings

    profile, settings = load_profile(args.profile), load_settings(args.settings)

    from lira.hal.bus.access_log import count_refusals
    from lira.hal.bus.bus import Bus
    from lira.hal.safety.governed import GovernedRobot
    from lira.hal.server.server import HalServer, stop_on_signal
    from lira.robot.rosbot import Devices, Rosbot

    robot = Rosbot(profile, Devices(args.base, args.lidar, args.camera, args.openni, settings))
    bus = Bus(args.name, listen=args.listen, insecure=args.insecure, refusals=count_refusals())
    try:
        with stop_on_signal() as stop:

            def ready() -> None:
                blind = "".join(f", without {device}" for device in args.without)
                print(
                    f"robot '{args.name}' serves ({profile.name}) on {args.listen}{blind}; stop with Ctrl-C", flush=True
                )
                threading.Thread(target=report, args=(robot, stop), daemon=True, name="status").start()

            HalServer(GovernedRobot(robot), bus, ready=ready).run(stop)
    finally:
        bus.close()
    return 0


def report(robot: Troubled, stop: threading.Event) -> None:
    """Say which device is lost, and when it is back."""
    known: dict[str, str] = {}
    while not stop.wait(LOOK_S):
        troubles = robot.troubles()
        for name in troubles.keys() - known.keys():
            print(f"the robot stands: {troubles[name]}", flush=True)
        for name in known.keys() - troubles.keys():
            print(f"the {name} is back; the robot moves again after a zero command", flush=True)
        known = troubles
