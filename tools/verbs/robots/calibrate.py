"""Calibrate the base: drive a known distance and turn on the spot, measure, and write the scales into the settings.

Stop `lira robot` first: this opens the devices itself. The robot moves only after you said yes, slowly, and stops at
Ctrl-C and at whatever looks wrong. With --lidar it measures by itself: put it 2 to 3 m before a flat wall, in a room
with corners, free all around. Without, you measure with a tape and a mark on the floor. What it finds goes into the
file that `lira robot --settings FILE` reads.

examples:
  lira calibrate base --base /dev/ttyS1 --lidar /dev/rplidar --settings my-robot.toml
  lira calibrate base --base /dev/ttyS1 --settings my-robot.toml --distance 2 --only distance
"""

import argparse
import math
import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.tools.options import add_profile

if TYPE_CHECKING:
    from lira.robot.settings import BaseSettings
    from lira.tools.calibration import Manoeuvre, Way

COARSE_RAD = math.pi  # reported: enough to know how many turns the fine one really makes
COARSE_WINDOW_RAD = math.radians(45.0)
FINE_WINDOW_RAD = math.radians(20.0)
PLAUSIBLE = (0.67, 1.5)
MOST_SLIP_M_RAD = 0.05
NO_WALL = ("there is no flat wall straight ahead", "Put the robot square before a wall, 2 to 3 m away")
KEYS = {"distance": "distance_scale", "turn": "turn_scale"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("what", choices=("base",), help="what to calibrate")
    add("--base", required=True, metavar="URL", help="CORE2 board: a serial port, or socket://host:port")
    add("--lidar", metavar="URL", help="RPLIDAR A2: measures in place of you, and looks where the robot goes")
    add("--by", choices=("lidar", "tape"), help="who measures (default: the lidar if there is one)")
    add("--settings", type=Path, required=True, metavar="FILE", help="file of settings to write (made if need be)")
    add("--only", choices=("distance", "turn"), help="calibrate one of the two (default: both)")
    add("--distance", type=float, default=1.0, metavar="M", help="how far to drive (default: %(default)s)")
    add("--turns", type=float, default=2.0, metavar="N", help="how many times to turn (default: %(default)s)")
    add_profile(parser, "rosbot2")
    add("--yes", action="store_true", help="the way is free: do not ask")


def run(args: argparse.Namespace) -> int:
    """Calibrate, and write what was found. Raises `LiraError` if anything is not as it should be."""
    by_lidar = args.by == "lidar" or (args.by is None and args.lidar is not None)
    if by_lidar and args.lidar is None:
        raise ConfigError("no --lidar to measure with", "Give its URL, or say --by tape.")
    if not (0.2 <= args.distance <= 5.0 and 0.5 <= args.turns <= 20.0):
        raise ConfigError("--distance is 0.2 to 5 (metres), --turns 0.5 to 20", "Choose within these.")

    from lira.hal.profile import load_profile
    from lira.hal.safety.governed import GovernedRobot
    from lira.robot.rosbot import Devices, Rosbot
    from lira.robot.settings import load_settings, write_base_setting
    from lira.tools.calibration import Manoeuvre, Pace

    profile = load_profile(args.profile)
    settings = load_settings(args.settings if args.settings.exists() else None)
    wanted = [name for name in KEYS if args.only in (None, name)]
    robot = GovernedRobot(Rosbot(profile, Devices(args.base, args.lidar, settings=settings)))
    if robot.field_off:
        raise ConfigError(robot.field_off, "Give --lidar, also with --by tape, or a --profile without [field].")
    ask_for_consent(args, wanted)
    with closing(robot):
        robot.open()
        manoeuvre = Manoeuvre(robot, Pace())
        for name in wanted:
            measure = (by_the_lidar if by_lidar else by_tape)[name]
            true, way = measure(manoeuvre, args)
            unit = "m" if name == "distance" else "rad"
            print(f"{name}: reported {way.done:.3f} {unit}, measured {true:.3f} {unit}", flush=True)
            for key, value in found(name, settings.base, true, way).items():
                write_base_setting(args.settings, key, value)
                print(
                    f"  {key} {getattr(settings.base, key):.4f} -> {value:.4f}, written to {args.settings}", flush=True
                )
    return 0


def found(name: str, before: "BaseSettings", true: float, way: "Way") -> dict[str, float]:
    """Return the settings that make what was reported true. Raises `CalibrationError` for what cannot be right."""
    scale = getattr(before, KEYS[name]) * true / way.done
    if not PLAUSIBLE[0] <= scale <= PLAUSIBLE[1]:
        raise not_measured(f"a scale of {scale:.2f} for the {name} cannot be right", "Measure again")
    if name == "distance":
        return {KEYS[name]: scale}
    # On the spot it goes nowhere: what it reports beside the turn is slip, in the board's own metres and radians.
    slip = before.spin_slip_m_rad + way.ahead_m / before.distance_scale / (way.turn_rad / before.turn_scale)
    if abs(slip) > MOST_SLIP_M_RAD:
        raise not_measured(f"{slip:.3f} m ahead for each radian of a turn cannot be right", "Turn it on an even floor")
    return {KEYS[name]: scale, "spin_slip_m_rad": slip}


def ask_for_consent(args: argparse.Namespace, wanted: list[str]) -> None:
    """Say what will happen, and go on only if the person agrees. Raises `ConfigError`."""
    moves = {
        "distance": f"drive {args.distance:g} m straight ahead (up to 1.3 times as far)",
        "turn": f"turn {args.turns:g} times on the spot",
    }
    print(f"The robot will {' and then '.join(moves[name] for name in wanted)}, slowly. Ctrl-C stops it.", flush=True)
    if args.yes:
        return
    if not sys.stdin.isatty():
        raise ConfigError("nobody is there to ask whether the way is free", "Run it in a terminal, or say --yes.")
    if input("Is the way free, and a hand at the power switch? [y/N] ").strip().lower() not in ("y", "yes"):
        raise ConfigError("the way is not free", "Nothing was moved and nothing was written.")


def distance_by_lidar(manoeuvre: "Manoeuvre", args: argparse.Namespace) -> tuple[float, "Way"]:
    """Return true metres and the way: the wall ahead comes nearer by what was driven."""
    from lira.robot.calibration import wall_ahead_m

    manoeuvre.check(ahead_m=args.distance, lidar=True)
    before_m = wall_ahead_m(manoeuvre.scan())
    if before_m is None:
        raise not_measured(*NO_WALL)
    way = manoeuvre.ahead(args.distance)
    after_m = wall_ahead_m(manoeuvre.scan())
    if after_m is None:
        raise not_measured(*NO_WALL)
    return before_m - after_m, way


def turn_by_lidar(manoeuvre: "Manoeuvre", args: argparse.Namespace) -> tuple[float, "Way"]:
    """Return true radians and the way: a small turn tells roughly, then the whole one exactly."""
    from lira.robot.calibration import turn_between

    manoeuvre.check(turns=True, lidar=True)
    first = manoeuvre.scan()
    reported_rad = manoeuvre.turn(COARSE_RAD).turn_rad
    second = manoeuvre.scan()
    coarse_rad = turn_between(first, second, reported_rad, COARSE_WINDOW_RAD)
    if coarse_rad is None:
        raise not_measured("the surroundings look alike at several turns", "Turn it where walls and corners are near")
    way = manoeuvre.turn(args.turns * math.tau)
    expected_rad = way.turn_rad * coarse_rad / reported_rad
    true_rad = turn_between(second, manoeuvre.scan(), expected_rad, FINE_WINDOW_RAD)
    if true_rad is None:
        raise not_measured("the turn cannot be told from the scans", "Keep the room still, and give fewer --turns")
    return true_rad, way


def distance_by_tape(manoeuvre: "Manoeuvre", args: argparse.Namespace) -> tuple[float, "Way"]:
    """Return true metres and the way; a person measures."""
    manoeuvre.check(ahead_m=args.distance, lidar=args.lidar is not None)
    way = manoeuvre.ahead(args.distance)
    return ask_number("How many metres did it drive? "), way


def turn_by_tape(manoeuvre: "Manoeuvre", args: argparse.Namespace) -> tuple[float, "Way"]:
    """Return true radians and the way; a person looks at a mark."""
    manoeuvre.check(turns=True, lidar=args.lidar is not None)
    way = manoeuvre.turn(args.turns * math.tau)
    beyond_deg = ask_number(f"How many degrees beyond {args.turns:g} turns did it go (short: negative)? ")
    return args.turns * math.tau + math.radians(beyond_deg), way


by_the_lidar = {"distance": distance_by_lidar, "turn": turn_by_lidar}
by_tape = {"distance": distance_by_tape, "turn": turn_by_tape}


def ask_number(question: str) -> float:
    """Ask until it is a number."""
    while True:
        try:
            return float(input(question).strip().replace(",", "."))
        except EOFError as error:
            raise not_measured("nobody says what was measured", "Run it in a terminal") from error
        except ValueError:
            print("A number, for example 1.04.", flush=True)


def not_measured(what: str, remedy: str) -> Exception:
    """What to raise when a measurement came to nothing."""
    from lira.tools.calibration import CalibrationError

    return CalibrationError(what, f"{remedy}, or say --by tape. Nothing was written.")
