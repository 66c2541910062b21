"""Compare two robots: the same script of motions on both, then rates, ages, step responses, scans and pictures.

Without robots it compares the twin with itself: directly on the bus, and through the drivers of the real robot on
emulated devices. Robots are named NAME@HOST:PORT. Put both in the same place, a twin into a world of your room, with a
metre of free floor on all sides: each stands for 3 s, then goes ahead, back, left and right. Stand by the switch.

examples:
  lira parity                                                    the twin, directly and through the wire
  lira parity --profile thesis-sim --out runs/parity
  lira parity rosbot@127.0.0.1:7447 rosbot@192.168.1.20:7447     a twin and a robot
  lira parity rosbot@127.0.0.1:7447 rosbot@192.168.1.20:7447 --json parity.json

exit status: 0 if nothing differs by more than is allowed, 1 if something does, 2 if something went wrong
"""

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError, StorageError
from lira.tools.launch.lifetime import CLOSE_S
from lira.tools.options import add_json, add_profile, add_seed, add_world

if TYPE_CHECKING:
    from lira.tools.launch.launch import Part
    from lira.tools.parity.compare import Row
    from lira.tools.parity.record import Recording

PAGE = "parity.html"
OWN = ("twin", "wire")
ATTEMPTS = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("robots", nargs="*", metavar="NAME@HOST:PORT", help="two robots (default: a twin, directly and by wire)")
    add_world(parser, "room", "the own twins' world")
    add_profile(parser, "rosbot2", "the own twins' robot")
    add_seed(parser, "seeds the own twins' noise")
    add("--settings", type=Path, metavar="FILE", help="of the own robot behind the wire, as of lira robot (.toml)")
    add_json(parser)
    add("--out", type=Path, metavar="DIR", help=f"folder for {PAGE} with the plots, and the logs of own processes")


def run(args: argparse.Namespace) -> int:
    """Drive both, print the table, write what was asked for."""
    from lira.tools.parity.compare import DIFFERS, compare

    ends = [address(word) for word in args.robots]
    if len(ends) not in (0, 2):
        raise ConfigError(
            f"parity compares two robots, not {len(ends)}", "Name two, or none for the twin and its wire."
        )
    first, second = [over_bus(*end) for end in ends] if ends else own(args)
    rows = compare(first, second)
    show(args, first, second, rows)
    return int(any(row.verdict == DIFFERS for row in rows))


def address(word: str) -> tuple[str, str]:
    """Split NAME@HOST:PORT. Raises `ConfigError`."""
    name, at, endpoint = word.partition("@")
    if not (name and at and endpoint):
        raise ConfigError(f"'{word}' names no robot", "Write NAME@HOST:PORT, for example rosbot@127.0.0.1:7447.")
    return name, endpoint


def over_bus(name: str, endpoint: str, shown: str = "") -> "Recording":
    """Drive a robot that is on the bus through the script."""
    from lira.hal.client.connect import on_bus
    from lira.tools.parity.record import record

    print(f"{shown or f'{name}@{endpoint}'}: ...", file=sys.stderr, flush=True)
    with on_bus(endpoint, name, close_s=CLOSE_S) as bus:
        return record(bus, shown or f"{name}@{endpoint}")


def own(args: argparse.Namespace) -> "tuple[Recording, Recording]":
    """Start the twin on the bus, drive it, and the same again through the wire; one after the other."""
    from lira.hal.profile import load_profile
    from lira.robot.settings import load_settings
    from lira.sim_backend.catalogue import load_world
    from lira.tools.launch.launch import direct, wired
    from lira.tools.launch.processes import free_port

    load_profile(args.profile)
    load_world(args.world)
    load_settings(args.settings)
    port = free_port()
    name, endpoint, arena = f"parity_{port}", f"127.0.0.1:{port}", f"127.0.0.1:{free_port()}"
    twin = ["--world", args.world, "--profile", args.profile, "--seed", str(args.seed)]
    settings = [] if args.settings is None else ["--settings", str(args.settings)]
    with ExitStack() as held:
        folder: Path = args.out or Path(held.enter_context(TemporaryDirectory(prefix="lira-parity-")))
        robots = (
            direct(name, endpoint, twin, lockstep=False),
            wired(name, endpoint, arena, folder / "wire", twin, settings),
        )
        first, second = (
            started(parts, folder / shown, name, endpoint, shown) for parts, shown in zip(robots, OWN, strict=True)
        )
    return first, second


def started(parts: "list[Part]", logs: Path, name: str, endpoint: str, shown: str) -> "Recording":
    """Start a robot's processes, drive it, and stop them; from the beginning again if the machine was too busy."""
    from lira.tools.launch.launch import running
    from lira.tools.parity.record import InterruptedScriptError

    for _ in range(ATTEMPTS - 1):
        try:
            with running(parts, logs):
                return over_bus(name, endpoint, shown)
        except InterruptedScriptError as error:
            print(f"{error.what}; once more", file=sys.stderr, flush=True)
    with running(parts, logs):
        return over_bus(name, endpoint, shown)


def show(args: argparse.Namespace, first: "Recording", second: "Recording", rows: "list[Row]") -> None:
    """Print the table, or write it as JSON and as a page."""
    import msgspec

    from lira.tools.output.machine import output_for, tell, write_file
    from lira.tools.output.table import format_table
    from lira.tools.parity.compare import cells
    from lira.tools.parity.page import COLUMNS, render

    output = output_for(args.json)
    if args.out is not None:
        try:
            args.out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StorageError(f"cannot write {args.out}: {error.strerror}", "Choose another folder.") from error
        write_file(args.out / PAGE, render(first, second, rows))
    robots = [{"name": each.name, "profile": each.profile.name} for each in (first, second)]
    text = msgspec.json.format(msgspec.json.encode({"robots": robots, "rows": rows}), indent=2).decode()
    columns = ("", "unit", first.name, second.name, *COLUMNS[4:])
    plots = "" if args.out is None else f"\n\nplots: {args.out / PAGE}"
    tell(args.json, output, text, format_table(columns, [cells(row) for row in rows]) + plots)
