"""Drive by hand: a gamepad on this machine, straight to the robot. Needs no screen.

Hold the dead-man (L1) to drive with the left stick, turbo (R1) for full speed. PS or SELECT is the emergency stop;
START, held for a second, releases it. Letting go of the dead-man gives control back at once. Square pauses and goes
on, triangle saves, circle, held for a second, begins anew; the d-pad gives control to an expert.

examples:
  lira joystick                                     the first pad whose layout is known
  lira joystick --device /dev/input/event5          this one
  lira joystick --learn my-pad.toml                 write the file of another pad by being asked for each control
  lira joystick --pad my-pad.toml
  lira joystick --rules                             the udev rule for who may not read pads
  lira joystick --connect 192.168.1.20:7447         a robot on another machine
"""

import argparse
import sys
from pathlib import Path

from lira.hal.errors import ConfigError, DeviceError
from lira.tools.options import add_client
from lira.tools.output.say import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add_client(parser)
    add("--pad", metavar="NAME|FILE", help="layout of the pad by name, or a .toml file (default: by what the pad is)")
    add("--device", metavar="PATH", help="the pad's /dev/input/event* or a link to it (default: the first that fits)")
    add("--learn", type=Path, metavar="FILE", help="ask for each control and write a new pad's file, then end")
    add("--rules", action="store_true", help="print the udev rule that lets this user read pads, then end")


def run(args: argparse.Namespace) -> int:
    """Bridge until told to stop."""
    if not sys.platform.startswith("linux"):
        raise DeviceError("gamepads are read through Linux's evdev", "Use `lira console`, which has a keyboard.")
    if args.rules:
        from lira.tools.joystick.device.rules import rules_text

        sys.stdout.write(rules_text())
        return 0
    from lira.tools.joystick.device.finder import Finder
    from lira.tools.joystick.pads.mapping import load_mapping

    mapping = None if args.pad is None else load_mapping(args.pad)
    if args.learn is not None:
        from lira.tools.joystick.pad_wizard import learn

        return learn(args.learn, args.device)

    from lira.tools.joystick.bridge import Bridge
    from lira.tools.joystick.known_pads import PadMemory, state_file
    from lira.tools.launch.notify import Notifier
    from lira.tools.operator.beside import beside

    notifier = Notifier.from_environment()
    with beside(args.name, args.connect) as robot:
        client = robot.client(say)
        if client is None:
            raise ConfigError(f"'{args.name}' waits for each command: no hand drives it", "Run it without --lockstep.")
        finder = Finder(mapping, args.device)
        bridge = Bridge(client, finder, PadMemory(state_file(), say), say, finder.advice)
        said = ""

        def alive() -> None:
            nonlocal said
            if (words := doing(bridge.pad, args)) != said:
                said = words
                notifier.ready(words)
            notifier.alive()

        say(f"{doing(bridge.pad, args)}; stop with Ctrl-C")
        bridge.run(robot.stop, alive)
    return 0


def doing(pad: str, args: argparse.Namespace) -> str:
    """What the bridge does with its pad, "" if there is none."""
    what = f"drives '{args.name}' at {args.connect}"
    return f"joystick {what} with {pad}" if pad else f"joystick waits for a pad, and then {what}"
