"""Play a recording on the bus: for the console, the web page, Foxglove, and for whatever else listens to a robot.

All that was told is told again, to the byte, with the alignment and at the speed at which it was recorded. With --robot
it is a robot instead: its sensors measure again what they measured, and it takes commands, but is where it was; so a
learner, an expert of yours or a new preprocessing can be tried on what was really seen.

examples:
  lira play runs/demo-20261127-101500                 beside it: lira console, lira web, lira view
  lira play runs/mine --speed 4 --from 30
  lira play runs/mine --step                          from decision to decision; Enter goes on
  lira play runs/mine --robot                         beside it: lira drive camera-expert, lira fusion --method plus
"""

import argparse
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.hal.words import plural
from lira.tools.options import DEFAULT, add_server

if TYPE_CHECKING:
    from lira.tools.recording.reader import Recorded, Recording

MOST = 100.0


def speed(text: str) -> float:
    """Read how fast."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= MOST:
        raise argparse.ArgumentTypeError(f"'{text}' is no speed: above 0, at most {MOST:g}")
    return value


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="an .mcap file, or the folder of a recording or a run")
    add("--speed", type=speed, default=1.0, help=f"times the robot's time {DEFAULT}")
    add("--from", dest="since", type=float, default=0.0, metavar="S", help="begin so many seconds after the beginning")
    add("--step", action="store_true", help="stand after each decision until Enter is pressed")
    add("--robot", action="store_true", help="be a robot with these sensors, which takes commands")
    add_server(parser)


def run(args: argparse.Namespace) -> int:
    """Play it to its end."""
    from lira.hal.signals import stop_on_signal
    from lira.tools.recording.reader import Recording

    if args.robot and (args.step or args.since):
        raise ConfigError("a robot's time is its own", "Leave out --step and --from, or --robot.")
    recording = Recording(args.file)
    with stop_on_signal() as stop:
        (be_robot if args.robot else tell)(args, recording, stop)
    return 0


def tell(args: argparse.Namespace, recording: "Recording", stop: threading.Event) -> None:
    """Tell all that was told."""
    from lira.hal.bus.bus import Bus
    from lira.tools.output.say import say
    from lira.tools.recording.player import Player

    def ask(each: "Recorded") -> bool:
        decision = each.message
        at_s = decision.stamp_s - recording.head.began_s
        print(f"{at_s:.1f} s: {decision.driver} drives, call: {decision.call}; Enter goes on", end=" ", flush=True)
        return wait_for_enter(player.serve, stop)

    bus = Bus(args.name, listen=args.listen, insecure=args.insecure)
    try:
        player = Player(recording, bus, speed=args.speed)
        say(f"plays {args.file} as '{args.name}' on {args.listen}; stop with Ctrl-C")
        if args.step:
            player.step(stop, ask, args.since)
        else:
            player.run(stop, args.since)
        say(f"told {plural(player.told, 'message')}")
    finally:
        bus.close()


def wait_for_enter(serve: Callable[[], None], stop: threading.Event) -> bool:
    """Serve until Enter is pressed; False if there is nobody to press it, or it is to end."""
    import select

    while not stop.is_set():
        if select.select([sys.stdin], [], [], 0.05)[0]:
            return bool(sys.stdin.readline())
        serve()
    return False


def be_robot(args: argparse.Namespace, recording: "Recording", stop: threading.Event) -> None:
    """Serve a robot that measures what was measured, until the recording is over."""
    import time

    from lira.hal.bus.topics import SIM_STATE
    from lira.hal.server.serve import serve
    from lira.tools.output.say import say
    from lira.tools.recording.recorded_robot import RecordedRobot

    robot = RecordedRobot(recording, time.monotonic, speed=args.speed)
    knows_truth = next(recording.messages(SIM_STATE), None) is not None

    def ready(_: object, ended: threading.Event) -> None:
        say(f"recorded robot '{args.name}' ({robot.profile.name}) on {args.listen}; stop with Ctrl-C")
        threading.Thread(target=end, args=[ended], name="end", daemon=True).start()

    def end(ended: threading.Event) -> None:
        while not robot.ended and not ended.wait(0.2):
            pass
        ended.set()

    serve(
        robot,
        args.name,
        args.listen,
        arena=robot if knows_truth else None,
        arena_info=robot.arena_info if knows_truth else b"null",
        insecure=args.insecure,
        ready=ready,
        stop=stop,
    )
    if robot.ended:
        say("the recording is over")
