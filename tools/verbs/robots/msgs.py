"""Write the ROS 2 package `lira_msgs`: our types, for `ros2 topic echo`, rosbag2 and nodes of your own.

`colcon build` makes it part of a workspace. The files are those that the bus itself is made of, so both sides know a
type by the same hash (docs/bus.md lists them).

examples:
  lira msgs ~/ros2_ws/src
  cd ~/ros2_ws && colcon build --packages-select lira_msgs && . install/setup.sh
  ros2 topic echo /rosbot/cmd_vel/applied
"""

import argparse
from pathlib import Path

from lira.hal.errors import ConfigError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("out", type=Path, metavar="OUT", help="folder to write it into, such as a workspace's src")


def run(args: argparse.Namespace) -> int:
    """Write it."""
    from lira.hal.config import write_whole
    from lira.hal.messages.ros.types import PACKAGE
    from lira.tools.cli import version
    from lira.tools.ros2.package import package_files

    folder = args.out / PACKAGE
    if folder.exists() and not (folder / "package.xml").is_file():
        raise ConfigError(f"{folder} is there and is no ROS package", "Name another folder, or move that one away.")
    for name, text in package_files(version()).items():
        write_whole(folder / name, text.encode(), folder=True)
    print(f"{folder}: build it with: colcon build --packages-select {PACKAGE}")
    return 0
