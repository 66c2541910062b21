"""Make the keys with which a robot knows who may drive it, and the bus is encrypted.

`init` makes a certificate authority and a bundle each for the robot and the laptop; `enroll` adds a person or machine.
A bundle is a folder to copy to whoever it is for; the folder `authority` stays where it is. A program uses the bundle
that the environment variable LIRA_KEYS names.

examples:
  lira keys init keys                         keys/authority, keys/robot, keys/laptop
  scp -r keys/robot husarion@rosbot:keys      then, on the robot: export LIRA_KEYS=~/keys
  export LIRA_KEYS=$PWD/keys/laptop           on the laptop
  lira keys enroll anna keys                  may drive and stop; copy keys/robot/writers.txt to the robot again
  lira keys enroll guest keys --viewer        may look and press the emergency stop only
  lira keys show keys                         who there is, and until when
"""

import argparse
from pathlib import Path

from hal.errors import ConfigError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    init = actions.add_parser("init", help="make an authority, and bundles for the robot and the laptop")
    enroll = actions.add_parser("enroll", help="make a bundle for one more person or machine")
    enroll.add_argument("name", help="letters, digits, - and _")
    enroll.add_argument("--viewer", action="store_true", help="may look, but not drive")
    show = actions.add_parser("show", help="who there is, and until when")
    for action in (init, enroll, show):
        action.add_argument("folder", nargs="?", type=Path, default=Path("keys"), help="default: %(default)s")


def run(args: argparse.Namespace) -> int:
    """Do what is asked."""
    from tools.authority import enroll, expiries, init

    folder: Path = args.folder
    if args.action == "init":
        init(folder)
        print(f"made {folder}/authority (keep it here), {folder}/robot (copy it to the robot), {folder}/laptop")
        print(f"use it with: export LIRA_KEYS={folder.resolve()}/laptop")
    elif args.action == "enroll":
        enroll(folder, args.name, drives=not args.viewer)
        print(f"made {folder / args.name}: copy it to whoever it is for")
        if not args.viewer:
            print(f"copy {folder}/robot/writers.txt to the robot again: it names who may drive")
    else:
        from tools.table import format_table

        rows = expiries(folder)
        if not rows:
            raise ConfigError(f"{folder} holds no keys", f"Make some with: lira keys init {folder}")
        print(format_table(["name", "valid until", "days left"], [list(row) for row in rows]))
    return 0
