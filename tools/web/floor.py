"""The map under the robot: what lies on a twin's floor; nothing for a real one."""

from typing import Any

from lira.hal.bus.services import Info, understood
from lira.sim_backend.world import World
from lira.tools.report.course import NOTHING, course


def floor_of(info: Info, layout: int) -> dict[str, Any]:
    """Line and outlines in metres, as the page draws them."""
    world: World | None = understood(World | None, bytes(info.arena))
    floor = NOTHING if world is None else course(world.name, layout)
    return {
        "world": None if world is None else world.name,
        "line": floor.line,
        "line_width_m": floor.line_width_m,
        "way": floor.way,
        "boxes": floor.boxes,
        "hanging": floor.hanging,
        "marks": floor.marks,
    }
