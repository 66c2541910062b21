"""Watch the robot learn: camera, scan, every expert's action and activation, who drives and why, and its calls.

It only looks, in a process of its own: closing it changes nothing. Without a gamepad the keyboard drives: hold SPACE
and use the arrows (SHIFT: full speed), Esc is the emergency stop, F1 held for a second releases it. P pauses driving
and learning and goes on, S saves, R held for a second begins a new episode, 1 to 4 give control to an expert. In a
session (lira teach) V asks for the proof, and U held for a second takes the last intervention's labels back.

examples:
  lira console
  lira console --connect 192.168.1.20:7447        a robot on another machine
  lira console --screenshot console.png           write a picture of a sample drive, and end
"""

import argparse
from pathlib import Path

from lira.hal.errors import ConfigError
from lira.tools.options import add_client


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add_client(parser)
    add("--no-keyboard", action="store_true", help="do not drive from the keyboard")
    add("--screenshot", type=Path, metavar="FILE", help="draw a sample without a robot or a screen into a .png")


def run(args: argparse.Namespace) -> int:
    """Show until the window is closed."""
    import os

    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    from lira.tools.console.window import Keyboard, save_picture, show

    if args.screenshot is not None:
        if args.screenshot.suffix.lower() != ".png":
            raise ConfigError(f"{args.screenshot} is no .png", "Give the file's name that ending.")
        from lira.tools.console.sample import sample_view

        save_picture(sample_view(), str(args.screenshot))
        print(f"written: {args.screenshot}")
        return 0

    from lira.tools.operator.beside import beside
    from lira.tools.operator.listen import Ears

    with beside(args.name, args.connect) as robot:
        client = None if args.no_keyboard else robot.client()
        keyboard = None if client is None else Keyboard(client)
        print(f"console shows '{args.name}' at {args.connect}", flush=True)
        show(Ears(robot.watch, robot.info).look, keyboard, robot.stop)
    return 0
