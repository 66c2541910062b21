"""Let a policy drive a robot on the bus: a novice that was taught, an expert, or a policy of your own.

It needs neither PyTorch nor a simulator, so that it also runs on the robot itself, without WiFi in between
(pip install 'lira-rosbot[robot,drive]'). A person may take control at any time. On a twin, with --unseen, it drives
through so many layouts and says how each went.

examples:
  lira drive runs/demo-1/novice.safetensors            let a novice drive
  lira drive runs/demo-1/novice.safetensors --ask      which stops and calls where it does not know
  lira drive runs/demo-1/novice.safetensors --layout 100 --unseen 3    through layouts 101 to 103 of a twin
  lira drive camera-expert                             let one expert drive
  lira drive mylab.experts:wall                        let your own policy drive

exit status: 1 if a layout was not passed
"""

import argparse

from lira.tools.launch.lifetime import CLOSE_S
from lira.tools.options import add_arena, add_client, add_layout, add_pair, add_paused, add_shield, natural


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add(
        "policy",
        metavar="POLICY",
        help="a .safetensors file, camera-expert, lidar-expert, depth-expert, or your own MODULE:OBJECT",
    )
    add_client(parser)
    add_arena(parser)
    add_paused(parser)
    add_pair(parser)
    add(
        "--ask",
        action="store_true",
        help="a novice of plus stands and calls where it knows less than in the runs that proved it",
    )
    add_shield(parser, "whoever drives")
    add(
        "--unseen",
        type=natural,
        default=0,
        help="drive so many layouts of a twin, those after --layout (default: until it is told to stop)",
    )
    add_layout(parser, "layout to reset a twin to")


def run(args: argparse.Namespace) -> int:
    """Drive until done or told to stop."""
    from lira.fusion.experts.load import check_named
    from lira.fusion.inference.threads import one_thread
    from lira.hal.client.connect import connect
    from lira.tools.output.say import say
    from lira.tools.runs.remote.alone import examine, show
    from lira.tools.runs.remote.reach import reports_of

    one_thread()
    check_named([args.policy], args.experts)
    with connect(args.connect, args.name, close_s=CLOSE_S) as robot:
        return (examine if args.unseen else show)(args, robot, reports_of(robot), say)
