"""A page in the browser to watch, teach and drive the robot: on this machine, a tablet or a phone.

It opens on this machine alone. With --listen it is reached from others, over TLS and by links that let one browser in:
that needs keys (lira keys), since whoever has the page drives the robot. Press Enter for new links.

The page's thumb is a hand like any other: hold the dead-man to drive; a page that is hidden, closed or cut off has let
go, and the robot stands. Everybody who looks can press the emergency stop.

examples:
  lira web                                     http://127.0.0.1:8080
  lira web --connect 192.168.1.20:7447         a robot on another machine
  lira web --listen 0.0.0.0                    for a phone: shows two links as QR codes, to drive and to look
  lira web --screenshot page.png               a picture of a sample drive, by the browser that is installed
"""

import argparse
import asyncio
import contextlib
import sys
import threading
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from lira.tools.options import DEFAULT, add_client, add_layout, port

if TYPE_CHECKING:
    from lira.tools.launch.notify import Notifier
    from lira.tools.web.access import Access


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add_client(parser)
    add("--listen", default="127.0.0.1", metavar="HOST", help=f"where the page is served {DEFAULT}")
    add("--port", type=port, default=8080, help=f"0 takes any that is free {DEFAULT}")
    add_layout(parser, "the twin's layout, for the map")
    add("--screenshot", type=Path, metavar="FILE", help="write a picture of the page with a sample drive, and end")


def run(args: argparse.Namespace) -> int:
    """Serve until stopped."""
    if args.screenshot is not None:
        from lira.tools.web.screenshot import save_page

        save_page(args.screenshot)
        print(f"written: {args.screenshot}")
        return 0

    from lira.hal.bus.security.keys import keys_from_environment
    from lira.tools.launch.notify import Notifier
    from lira.tools.operator.beside import beside
    from lira.tools.operator.listen import Ears
    from lira.tools.web.access import Access, own_names, tls_context
    from lira.tools.web.controls import Controls
    from lira.tools.web.seat import Seat
    from lira.tools.web.server import PageServer, serve_page
    from lira.tools.web.settings import settings_of

    notifier = Notifier.from_environment()
    tls = tls_context(keys_from_environment(), args.listen)
    access = Access(open_here=tls is None, hosts=own_names(args.listen))
    with contextlib.ExitStack() as stack:
        robot = stack.enter_context(beside(args.name, args.connect))
        ears, seat, client = Ears(robot.watch, robot.info), Seat(), robot.client()
        controls = None if client is None else stack.enter_context(contextlib.closing(Controls(client, seat)))
        settings = partial(settings_of, robot.info, args.name, args.layout)
        server = PageServer(ears.look, seat, access, controls, settings)
        tell = partial(_tell, args, access, notifier)
        asyncio.run(serve_page(server, args.listen, args.port, tls, tell, robot.stop, notifier.alive))
    return 0


def _tell(args: argparse.Namespace, access: "Access", notifier: "Notifier", port: int) -> None:
    """Say where the page is; from other machines by links, and by new ones for each line on the terminal."""
    where = f"at http://{args.listen}:{port}" if access.open_here else f"on port {port}, by a link for one browser each"
    words = f"web shows '{args.name}' {where}"
    notifier.ready(words)
    if access.open_here:
        print(words, flush=True)
        return
    print(f"{words}; Enter makes new ones", flush=True)
    _tell_links(access, port)
    if sys.stdin is not None and sys.stdin.isatty():
        threading.Thread(target=_offer_links, args=(access, port), name="links", daemon=True).start()


def _offer_links(access: "Access", port: int) -> None:
    for _ in sys.stdin:
        _tell_links(access, port)


def _tell_links(access: "Access", port: int) -> None:
    import segno

    for words, drives in (("to drive and teach", True), ("to look and stop", False)):
        link = f"https://{access.best_host}:{port}/enter/{access.new_link(time.monotonic(), drives=drives)}"
        print(f"\n{words}: {link}", flush=True)
        if drives and sys.stdout.isatty():
            segno.make(link, error="l").terminal(compact=True)
