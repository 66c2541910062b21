"""A robot's model as URDF, from its profile: the frames of its sensors, and boxes and cylinders to look at. Pure."""

import math
import xml.etree.ElementTree as ET

from lira.hal.description.frames import Mount, mounts_of
from lira.hal.messages.description import BASE, CAMERA_LINK, LASER, Vector
from lira.hal.profile import RobotProfile

WHEEL_WIDTH_M = 0.03
CLEARANCE_M = 0.02  # below a body whose wheels nobody has measured
AXLES = (0.28, -0.28)  # shares of the body's length, ahead of its middle
SENSOR_SHAPES: dict[str, tuple[str, dict[str, str]]] = {
    LASER: ("cylinder", {"radius": "0.035", "length": "0.04"}),
    CAMERA_LINK: ("box", {"size": "0.03 0.16 0.03"}),
}
COLOURS = {"body": "0.75 0.1 0.1 1", "dark": "0.15 0.15 0.15 1"}


def urdf_of(profile: RobotProfile) -> str:
    """Return the model. Its wheels are part of the body, as nobody measures their angles."""
    robot = ET.Element("robot", name=profile.name)
    for name, rgba in COLOURS.items():
        ET.SubElement(ET.SubElement(robot, "material", name=name), "color", rgba=rgba)
    _add_body(ET.SubElement(robot, "link", name=BASE), profile)
    for mount in mounts_of(profile):
        link = ET.SubElement(robot, "link", name=mount.child)
        if mount.child in SENSOR_SHAPES:
            _add_shape(link, "visual", *SENSOR_SHAPES[mount.child])
        _add_joint(robot, mount)
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def _add_body(link: ET.Element, profile: RobotProfile) -> None:
    """The body as a box between floor and top, what it collides with, and four wheels if their size is known."""
    base = profile.base
    bottom_m = min(base.wheel_radius_m or CLEARANCE_M, base.height_m / 2)
    top_m = max(min(base.height_m, profile.lidar.z_m - 0.02), bottom_m + 0.01)
    size = f"{base.length_m:g} {base.width_m - 2 * WHEEL_WIDTH_M:g} {top_m - bottom_m:g}"
    _add_shape(link, "visual", "box", {"size": size}, (0.0, 0.0, (top_m + bottom_m) / 2), material="body")
    hull = {"size": f"{base.length_m:g} {base.width_m:g} {base.height_m:g}"}
    _add_shape(link, "collision", "box", hull, (0.0, 0.0, base.height_m / 2))
    if base.wheel_radius_m is None:
        return
    wheel = {"radius": f"{base.wheel_radius_m:g}", "length": f"{WHEEL_WIDTH_M:g}"}
    for share in AXLES:
        for side in (1.0, -1.0):
            at = (share * base.length_m, side * base.track_m / 2, base.wheel_radius_m)
            _add_shape(link, "visual", "cylinder", wheel, at, (math.pi / 2, 0.0, 0.0))


def _add_shape(
    link: ET.Element,
    kind: str,
    shape: str,
    size: dict[str, str],
    xyz_m: Vector = (0.0, 0.0, 0.0),
    rpy_rad: Vector = (0.0, 0.0, 0.0),
    material: str = "dark",
) -> None:
    part = ET.SubElement(link, kind)
    ET.SubElement(part, "origin", xyz=_numbers(xyz_m), rpy=_numbers(rpy_rad))
    ET.SubElement(ET.SubElement(part, "geometry"), shape, size)
    if kind == "visual":
        ET.SubElement(part, "material", name=material)


def _add_joint(robot: ET.Element, mount: Mount) -> None:
    joint = ET.SubElement(robot, "joint", name=f"{mount.child}_joint", type="fixed")
    ET.SubElement(joint, "parent", link=mount.parent)
    ET.SubElement(joint, "child", link=mount.child)
    ET.SubElement(joint, "origin", xyz=_numbers(mount.xyz_m), rpy=_numbers(mount.rpy_rad))


def _numbers(values: Vector) -> str:
    return " ".join(f"{value:.7g}" for value in values)
