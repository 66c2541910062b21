"""Start all that a robot needs, and keep it running: a twin or, with --robot, the link to a real one, and around it the
learner, the recorder, the page in the browser, the gamepad and the monitor. It returns when all of it runs, and the
processes stay.

Nothing drives by itself: the learner or the driver begins paused, and a person asks it to go on (P on a screen, square
on the pad). What dies is started again after a pause, and begins paused again. `lira status`, `lira logs` and
`lira down` are the rest of its life.

examples:
  lira up                                          a twin in the line world, taught on the page
  lira up --world line-obstacles --method hold
  lira up --robot 192.168.1.20                     a real robot, which runs `lira robot` itself
  lira up --policy runs/demo-1/novice.safetensors  a novice drives instead of being taught
  lira up --set look --without pad                 only look at it
  lira up --name second                            one more beside it
  lira up --stay                                   stay in this terminal, or be a container's command

exit status: 0 when all of it runs, also if it did before; 1 if something else is up under that name
"""

import argparse
import time

from lira.tools.lifecycle.arguments import add_setup
from lira.tools.output.say import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_setup(parser)
    parser.add_argument("--stay", action="store_true", help="do not leave: Ctrl-C takes all of it down")


def run(args: argparse.Namespace) -> int:
    """Bring it up, or say what is up already."""
    from lira.tools.lifecycle.arguments import Ports, check_packages, check_policy, setup_of
    from lira.tools.lifecycle.control import bring_up, supervise
    from lira.tools.lifecycle.ports import free_from
    from lira.tools.lifecycle.setup import PAGE_PORT, PORT, command_line
    from lira.tools.lifecycle.watch.status import as_text, look

    before = look(args.name, time.monotonic())
    if before.state is not None:
        now = before.state.setup
        same = now == setup_of(args, Ports(int(now.endpoint.rpartition(":")[2]), now.page_port))
        other = "" if same else f", as something else ({command_line('down', args.name)} ends it)"
        print(f"already up{other}:\n\n{as_text(before)}")
        return 0 if same else 1
    setup = setup_of(args, Ports(free_from(PORT), free_from(PAGE_PORT)))
    check_packages(setup)
    check_policy(setup)
    if args.stay:
        supervise(setup, say)
        return 0
    bring_up(setup, say)
    does = "teach and drive it" if "learner" in setup.processes else "watch and drive it"
    page = f"; {does} at http://127.0.0.1:{setup.page_port}" if "page" in setup.processes else ""
    say(f"up: {setup.where}{page}")
    return 0
