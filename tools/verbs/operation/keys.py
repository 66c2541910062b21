"""Make the keys with which a robot knows who may drive it, and the bus is encrypted.

`init` makes a bundle each for the robot and the laptop; `enroll` adds a person or machine, `revoke` shuts one out,
`renew` gives one a new certificate with the same name. A bundle is a folder to copy to whoever it is for; the folder
`authority` stays where it is. A program uses the bundle that the environment variable LIRA_KEYS names.

Whoever is enrolled drives, in its own name; a viewer may look and press the emergency stop only; a ROS bridge drives on
the plain cmd_vel. The robot's bundle says who they are: copy ca.pem and roles.txt in it to the robot after enroll and
revoke. A running robot reads them within a second, and begins all links anew.

examples:
  lira keys init keys                         keys/authority, keys/robot, keys/laptop
  scp -r keys/robot husarion@rosbot:keys      then, on the robot: export LIRA_KEYS=~/keys
  export LIRA_KEYS=$PWD/keys/laptop           on the laptop
  lira keys enroll anna keys                  may drive and stop, for 30 days
  lira keys enroll guest keys --viewer        may look and press the emergency stop only
  lira keys revoke laptop keys                it was lost: its links end, for good
  scp keys/robot/*.* husarion@rosbot:keys     tell the robot who is enrolled and who is revoked
  lira keys renew anna keys                   30 more days: copy keys/anna/cert.pem to anna
  lira keys show keys                         who there is, as what, and until when
"""

import argparse
from datetime import timedelta
from pathlib import Path

from lira.hal.errors import ConfigError

MOST_DAYS = 3650


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    init = actions.add_parser("init", help="make bundles for the robot and the laptop")
    enroll = actions.add_parser("enroll", help="make a bundle for one more person or machine")
    renew = actions.add_parser("renew", help="a new certificate with the same name")
    revoke = actions.add_parser("revoke", help="shut somebody out, for good")
    show = actions.add_parser("show", help="who there is, as what, and until when")
    for action in (enroll, renew, revoke):
        action.add_argument("name", help="letters, digits, - and _")
    role = enroll.add_mutually_exclusive_group()
    role.add_argument("--viewer", action="store_true", help="may look and press the emergency stop, but not drive")
    role.add_argument("--bridge", action="store_true", help="a ROS bridge: drives on the plain cmd_vel")
    for action in (init, enroll, renew):
        action.add_argument(
            "--days", type=_days, metavar="N", help="how long the certificate lives (default: 30; a robot's: 730)"
        )
    for action in (init, enroll, renew, revoke, show):
        action.add_argument("folder", nargs="?", type=Path, default=Path("keys"), help="default: %(default)s")


def _days(text: str) -> timedelta:
    days = int(text) if text.isdecimal() and len(text) <= len(str(MOST_DAYS)) else 0
    if not 1 <= days <= MOST_DAYS:
        raise argparse.ArgumentTypeError(f"'{text}' is no number of days: 1 to {MOST_DAYS}")
    return timedelta(days=days)


def run(args: argparse.Namespace) -> int:
    """Do what is asked."""
    from lira.hal.bus.security.keys import CA, CERTIFICATE, ROLES, Role
    from lira.tools.authority import PEER_LIFE, ROBOT, enroll, init, renew, revoke

    folder: Path = args.folder
    tell_robot = f"copy {CA} and {ROLES} of {folder / ROBOT} to the robot again: they name who is enrolled"
    if args.action == "init":
        init(folder, args.days or PEER_LIFE)
        print(f"made {folder}/authority (keep it here), {folder}/robot (copy it to the robot), {folder}/laptop")
        print(f"use it with: export LIRA_KEYS={folder.resolve()}/laptop")
    elif args.action == "enroll":
        role = Role.VIEWER if args.viewer else Role.BRIDGE if args.bridge else Role.OPERATOR
        enroll(folder, args.name, role, args.days or PEER_LIFE)
        print(f"made {folder / args.name}: copy it to whoever it is for")
        print(tell_robot)
    elif args.action == "renew":
        renew(folder, args.name, args.days)
        print(f"renewed: copy {folder / args.name / CERTIFICATE} to whoever it is for")
    elif args.action == "revoke":
        revoke(folder, args.name)
        print(f"revoked {args.name}")
        print(tell_robot)
    else:
        _show(folder)
    return 0


def _show(folder: Path) -> None:
    from lira.tools.authority import enrolled
    from lira.tools.output.table import format_table

    found = enrolled(folder)
    if not found:
        raise ConfigError(f"{folder} holds no keys", f"Make some with: lira keys init {folder}")
    rows = [[peer.name, peer.role, f"{peer.until:%Y-%m-%d}", str(peer.days_left), peer.warning] for peer in found]
    print(format_table(["name", "role", "valid until", "days left", ""], rows))
