"""The page that `lira ros2 --look` prints. Pure."""

import shlex

from lira.hal.bus.topics import INFO
from lira.hal.ros_graph.look import Sight
from lira.tools.ros2.sight import Found, Place, lacking, sort, words

NOTHING = "nothing comes there, and nobody says that they are there"
IN_THE_WAY = (
    "Is its ROS running? Or is the domain (ROS_DOMAIN_ID) or the bridge's configuration (allow, deny) in the way?"
)
SILENT = "nothing came on any of these topics: is the driver of the robot's sensors running?"


def page(sight: Sight, address: str) -> list[str]:
    """Lines that list what comes on which key, and say with which words it is driven."""
    found = sort(sight)
    if not found:
        return [NOTHING, f"  {IN_THE_WAY}"]
    lines = []
    for place in sorted(found, key=lambda each: (each.robot, -1 if each.domain is None else each.domain)):
        there = found[place]
        nodes = sorted({node.name for node in sight.nodes if node.domain == place.domain})
        lines += [_title(place), *([f"  nodes: {', '.join(nodes)}"] if nodes else []), *_rows(there)]
        lines += [f"  {each}" for each in lacking(place, there)]
        lines += ["  drive it with:", f"    {shlex.join(words(place, there, address))}", ""]
    return lines[:-1] if sight.heard else [*lines, SILENT]


def _title(place: Place) -> str:
    if place.robot:
        return f"our own bus, robot '{place.robot}': keys {place.robot}/TOPIC (it answers {place.robot}/{INFO})"
    if place.domain is not None:
        return f"ROS 2 over rmw_zenoh, domain {place.domain}: keys {place.domain}/TOPIC/TYPE/HASH"
    return "ROS 2 behind zenoh-bridge-ros2dds: keys NAMESPACE/TOPIC"


def _rows(there: Found) -> list[str]:
    rows = [["topic", "type", "Hz", "bytes", "attached"]]
    types = there.topics
    for name in sorted({*types, *there.came}):
        came = there.came.get(name)
        told = ["-", "-", "-"] if came is None else [f"{came.rate_hz:.1f}", str(came.bytes_each), came.attached]
        rows.append([name, types.get(name, "?"), *told])
    rows += [[name, kind, "listens", "", ""] for name, kind in sorted(there.commanded.items())]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  " + "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]
