"""Show a robot in Foxglove: its body, scan, camera, actions, activations and decisions, as they come.

It looks and nothing else: no viewer reaches the robot through it, and a slow one loses pictures and changes nothing.
It serves on this machine alone; from another one come by ssh: ssh -L 8765:127.0.0.1:8765 LAPTOP.

examples:
  lira view                                    Foxglove connects to ws://127.0.0.1:8765
  lira view --layout lira.json                 write the layout to import in Foxglove, and end
  lira view --metrics 9464                     Prometheus finds numbers at http://127.0.0.1:9464/metrics, too
"""

import argparse
import contextlib
from pathlib import Path

from lira.tools.options import DEFAULT, add_client, port

HERE = "127.0.0.1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add_client(parser)
    add("--port", type=port, default=8765, help=f"where Foxglove connects; 0 takes any that is free {DEFAULT}")
    add("--metrics", type=port, metavar="PORT", help="serve numbers for Prometheus there")
    add("--layout", type=Path, metavar="FILE", help="write Foxglove's layout for this robot, and end")


def run(args: argparse.Namespace) -> int:
    """Serve until stopped."""
    if args.layout is not None:
        from lira.tools.view.layout import save_layout

        save_layout(args.layout, args.name)
        print(f"written: {args.layout}; in Foxglove choose Layout, Import from file")
        return 0

    from lira.hal.bus.bus import Bus
    from lira.tools.launch.lifetime import CLOSE_S, stop_or_interrupt
    from lira.tools.view.foxglove_viewer import FoxgloveViewer
    from lira.tools.view.source import LiveSource
    from lira.tools.view.stream import Viewer, give_way, stream

    give_way()
    with contextlib.ExitStack() as stack:
        stop = stack.enter_context(stop_or_interrupt())
        watch = Bus(args.name, connect=args.connect, watch=True)
        stack.callback(watch.close, CLOSE_S)
        source = LiveSource(watch)
        foxglove = stack.enter_context(contextlib.closing(FoxgloveViewer(args.name, source.topics, HERE, args.port)))
        viewers: list[Viewer] = [foxglove]
        print(f"view shows '{args.name}' at ws://{HERE}:{foxglove.port}, or open {foxglove.link}", flush=True)
        if args.metrics is not None:
            from lira.tools.view.metrics import Metrics

            metrics = stack.enter_context(contextlib.closing(Metrics(HERE, args.metrics, watch.boundary)))
            viewers.append(metrics)
            print(f"numbers for Prometheus at http://{HERE}:{metrics.port}/metrics", flush=True)
        stream(source, viewers, stop)
    return 0
