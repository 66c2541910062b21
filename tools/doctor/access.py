"""What this user may open: serial ports, cameras, pads, keys, network ports."""

import glob
import grp
import os
from pathlib import Path

from lira.hal.bus.security.keys import VARIABLE, keys_from_environment
from lira.tools.doctor.finding import Finding, Patient, fail, ok, warn
from lira.tools.joystick.device.rules import PLACE, REMEDY
from lira.tools.joystick.pads.nodes import is_any_pad, motion_of, read_nodes
from lira.tools.lifecycle.ports import taken
from lira.tools.lifecycle.setup import PORT

SERIAL = ("/dev/serial/by-id/*", "/dev/rplidar", "/dev/core2", "/dev/ttyUSB*", "/dev/ttyACM*")
CAMERAS = ("/dev/video*",)
ORBBEC = "2bc5"


def serial_ports(_: Patient) -> list[Finding]:
    """Ports that a lidar or a base may hang on: each by its best name, once."""
    ports = {os.path.realpath(path): path for pattern in reversed(SERIAL) for path in glob.glob(pattern)}  # noqa: PTH207
    if not ports:
        return [ok("no USB serial port: no lidar, no base by USB", ports=[])]
    return [_openable(path, "dialout") for path in sorted(ports.values())]


def cameras(_: Patient) -> list[Finding]:
    """UVC cameras, and an Astra."""
    found = [_openable(path, "video") for path in sorted(glob.glob(CAMERAS[0]))]  # noqa: PTH207
    for vendor in Path("/sys/bus/usb/devices").glob("*/idVendor"):
        if _read(vendor) == ORBBEC:
            folder = vendor.parent
            bus, number = _read(folder / "busnum"), _read(folder / "devnum")
            found.append(_openable(f"/dev/bus/usb/{int(bus or 0):03d}/{int(number or 0):03d}", "video", "an Astra at "))
    return found or [ok("no camera on USB", cameras=[])]


def pads(_: Patient) -> list[Finding]:
    """Gamepads, and whether their motion sensors may be read."""
    nodes = read_nodes()
    found = []
    for node in (node for node in nodes if is_any_pad(node)):
        motion = motion_of(node, nodes)
        if not os.access(node.path, os.R_OK):
            found.append(fail(f"no permission to read {node}", REMEDY, pad=str(node)))
        elif motion is not None and not os.access(motion.path, os.R_OK):
            found.append(warn(f"{node}, without permission for its motion sensors", REMEDY, pad=str(node)))
        else:
            found.append(ok(str(node), pad=str(node)))
    rule = "installed" if Path(PLACE).exists() else "not installed: lira joystick --rules"
    return found or [ok(f"no gamepad (udev rule {rule})", rule=Path(PLACE).exists())]


def keys(_: Patient) -> Finding:
    """The keys of the bus, if LIRA_KEYS names some. Raises `ConfigError` for what is wrong with them."""
    bundle = keys_from_environment()
    if bundle is None:
        return ok(f"no keys ({VARIABLE} is not set): robots are served to this machine alone", keys="")
    return ok(f"keys of '{bundle.name}' in {bundle.folder}", keys=bundle.name)


def ports(_: Patient) -> Finding:
    """Whether a robot can be served on this machine."""
    kinds = taken(PORT)
    if kinds:
        remedy = "That is right where a robot or a twin runs; else: ss -lptun | grep 7447, or --listen another port."
        return ok(f"port {PORT} is in use ({', '.join(kinds)}). {remedy}", taken=kinds)
    return ok(f"port {PORT} is free", taken=kinds)


def _openable(path: str, group: str, what: str = "") -> Finding:
    if os.access(path, os.R_OK | os.W_OK):
        return ok(f"{what}{path}", path=path)
    try:
        owner = grp.getgrgid(Path(path).stat().st_gid).gr_name
    except (OSError, KeyError):
        owner = group
    joined = group if owner == "root" else owner
    remedy = f"sudo usermod -aG {joined} $USER, and log in again; or install the udev rules of robot/README.md."
    return fail(f"no permission to open {what}{path}", remedy, path=path)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return ""
