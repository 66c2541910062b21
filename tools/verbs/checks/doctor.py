"""Look at this machine and at the devices that are named, and say what is wrong with them and what to do.

Each line is ok, a warning, or failed. Nothing is driven: the base stands, the lidar turns while it is looked at. A
device serves one program, so stop `lira robot` before its devices are looked at.

examples:
  lira doctor                                       this machine
  lira doctor --lidar /dev/rplidar --base /dev/ttyS1 --camera openni:
  lira doctor --camera http://NAME:PASSWORD@camera/video --out picture.jpg
  lira doctor --pad                                 the gamepad: hands off meanwhile
  lira doctor --connect 192.168.1.20:7447           the way to a robot: links, loss, round trip
"""

import argparse
from pathlib import Path

from lira.hal.bus.endpoint import DEFAULT_ROBOT
from lira.tools.options import add_json, add_profile


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--lidar", metavar="URL", help="look at an RPLIDAR: /dev/…, or socket://HOST:PORT")
    add("--base", metavar="URL", help="look at a CORE2, likewise")
    add("--camera", metavar="URL", help="look at a camera: openni:, /dev/video0, http://…, rtsp://…, a folder")
    add("--pad", action="store_true", help="look at the gamepad")
    add("--device", metavar="PATH", help="the pad's /dev/input/event* or a link to it (default: the first that fits)")
    add("--connect", metavar="HOST:PORT", help="look at the way to a robot")
    add("--name", default=DEFAULT_ROBOT, help="the robot's name on the bus (default: %(default)s)")
    add_profile(parser, "rosbot2")
    add("--settings", type=Path, metavar="FILE", help="how this robot is mounted and calibrated")
    add("--openni", type=Path, metavar="DIR", help="folder of OpenNI2, for openni: cameras")
    add("--seconds", type=float, default=4.0, metavar="S", help="how long each device is looked at (default: 4)")
    add("--out", type=Path, metavar="FILE", help="keep a picture of the camera")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Look at everything; 1 if something failed."""
    from lira.hal.errors import ConfigError
    from lira.hal.profile import load_profile
    from lira.robot.settings import load_settings
    from lira.tools.doctor.checks import examine, worst
    from lira.tools.doctor.finding import Level, Patient
    from lira.tools.output.machine import output_for, tell

    if not 0.5 <= args.seconds <= 600.0:
        raise ConfigError(f"--seconds {args.seconds} is out of range", "Give 0.5 to 600.")
    load_settings(args.settings)
    wanted = {name: getattr(args, name) for name in Patient.__dataclass_fields__ if name != "profile"}
    patient = Patient(load_profile(args.profile), **wanted)
    output = output_for(args.json)
    findings = []
    for name, finding in examine(patient):
        findings.append((name, finding))
        if args.json != "-":
            print(f"{finding.level:<8} {name}: {finding.what}", file=output, flush=True)
            if finding.remedy:
                print(f"{'':<8} {finding.remedy}", file=output, flush=True)
    level = worst([finding for _, finding in findings])
    rows = [
        {"check": name, "level": each.level, "what": each.what, "remedy": each.remedy, "values": dict(each.values)}
        for name, each in findings
    ]
    failed = sorted({name for name, finding in findings if finding.level is Level.FAILED})
    tell(args.json, output, {"name": "doctor", "level": level, "failed": failed, "checks": rows})
    return 1 if level is Level.FAILED else 0
