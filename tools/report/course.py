"""What stands on the floor in one layout of a world, as the top view draws it."""

import math
from dataclasses import dataclass
from functools import lru_cache

from hal.errors import ConfigError
from sim_backend.catalogue import load_world
from sim_backend.layout import Block, build
from tools.report.svg import Point


@dataclass(frozen=True, slots=True)
class Course:
    """The painted line in metres and the outlines of the obstacles, in the world's frame."""

    line: tuple[Point, ...] = ()
    line_width_m: float = 0.1
    outlines: tuple[tuple[Point, ...], ...] = ()


NOTHING = Course()


@lru_cache
def course(world_name: str, layout: int) -> Course:
    """Return the floor of a layout; nothing for a world that is not there any more (a user's own file)."""
    try:
        world = load_world(world_name)
    except ConfigError:
        return NOTHING
    floor = build(world, layout)
    outlines = tuple(map(outline, floor.blocks))
    if world.line is None:
        return Course(outlines=outlines)
    return Course(tuple((float(x), float(y)) for x, y in floor.curve.points), world.line.width_m, outlines)


def outline(block: Block) -> tuple[Point, ...]:
    """Return the four corners of a box."""
    cos, sin = math.cos(block.yaw_rad), math.sin(block.yaw_rad)
    return tuple(
        (block.x_m + cos * x - sin * y, block.y_m + sin * x + cos * y)
        for x, y in (
            (block.length_m / 2 * side, block.width_m / 2 * end) for side, end in ((1, 1), (-1, 1), (-1, -1), (1, -1))
        )
    )
