"""Show a robot in Foxglove or Rerun: its body, scan, camera, actions and decisions, live or from a recording.

It looks and nothing else: no viewer reaches the robot through it, and a slow one loses pictures and changes nothing.
It serves on this machine alone; from another one come by ssh: ssh -L 8765:127.0.0.1:8765 LAPTOP.

examples:
  lira view                                    Foxglove connects to ws://127.0.0.1:8765
  lira view --layout lira.json                 write the layout to import in Foxglove, and end
  lira view --metrics 9464                     Prometheus finds numbers at http://127.0.0.1:9464/metrics, too
  lira view --rerun                            in Rerun's viewer instead
  lira view runs/mine --rerun mine.rrd         a recording as a file of Rerun's, as fast as it can be read
"""

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from lira.tools.options import DEFAULT, add_client, port

if TYPE_CHECKING:
    from lira.hal.bus.boundary import Boundary
    from lira.tools.view.source import Source
    from lira.tools.view.stream import Viewer

HERE = "127.0.0.1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("file", type=Path, nargs="?", metavar="FILE", help="a recording, or the folder of a run, instead of a robot")
    add_client(parser)
    add("--port", type=port, default=8765, help=f"where Foxglove connects; 0 takes any that is free {DEFAULT}")
    add(
        "--rerun", type=Path, nargs="?", const=Path(), metavar="OUT", help="Rerun instead: its viewer, or a file (.rrd)"
    )
    add("--speed", type=_speed, help="how much faster than it was FILE is told; 0: at once (default: 1; 0 into a file)")
    add("--metrics", type=port, metavar="PORT", help="serve numbers for Prometheus there")
    add("--layout", type=Path, metavar="OUT", help="write Foxglove's layout for this robot, and end")


def _speed(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < 1e6:
        raise argparse.ArgumentTypeError(f"'{text}' is no speed: 0, or more")
    return value


def run(args: argparse.Namespace) -> int:
    """Show until stopped, or until the recording ends."""
    if args.layout is not None:
        from lira.tools.view.layout import save_layout

        save_layout(args.layout, args.name)
        print(f"written: {args.layout}; in Foxglove choose Layout, Import from file")
        return 0

    from lira.tools.launch.lifetime import stop_or_interrupt
    from lira.tools.view.stream import give_way, stream

    give_way()
    with contextlib.ExitStack() as stack:
        stop = stack.enter_context(stop_or_interrupt())
        robot, source, boundary = _source(args, stack)
        viewers = [stack.enter_context(contextlib.closing(each)) for each in _viewers(args, robot, source, boundary)]
        stream(source, viewers, stop)
        if args.rerun is None and not stop.is_set():
            print("the recording is over; Foxglove has it until Ctrl-C", flush=True)
            stop.wait()
    return 0


def _source(args: argparse.Namespace, stack: contextlib.ExitStack) -> "tuple[str, Source, Boundary]":
    """The robot's name, what is looked at, and what counts what was not taken."""
    from lira.hal.bus.boundary import Boundary
    from lira.hal.client.connect import on_bus
    from lira.tools.launch.lifetime import CLOSE_S
    from lira.tools.view.source import LiveSource, PlayedSource

    if args.file is not None:
        from lira.tools.view.played import open_recording

        robot, samples = open_recording(args.file)
        into_file = args.rerun not in (None, Path())
        return (
            robot,
            PlayedSource(samples, (0.0 if into_file else 1.0) if args.speed is None else args.speed),
            Boundary(),
        )
    watch = stack.enter_context(on_bus(args.connect, args.name, watch=True, close_s=CLOSE_S))
    return args.name, LiveSource(watch), watch.boundary


def _viewers(args: argparse.Namespace, robot: str, source: "Source", boundary: "Boundary") -> "Iterator[Viewer]":
    """Open those that were asked for, and say where they are."""
    if args.rerun is None:
        from lira.tools.view.foxglove_viewer import FoxgloveViewer

        foxglove = FoxgloveViewer(robot, source.topics, HERE, args.port)
        yield foxglove
        print(f"view shows '{robot}' at ws://{HERE}:{foxglove.port}, or open {foxglove.link}", flush=True)
    else:
        from lira.tools.view.rerun_viewer import RerunViewer

        file = None if args.rerun == Path() else args.rerun
        yield RerunViewer(robot, file)
        print(f"view shows '{robot}' in {file or 'the viewer of Rerun'}", flush=True)
    if args.metrics is not None:
        from lira.tools.view.metrics import Metrics

        metrics = Metrics(HERE, args.metrics, boundary)
        yield metrics
        print(f"numbers for Prometheus at http://{HERE}:{metrics.port}/metrics", flush=True)
