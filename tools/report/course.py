"""What is on the floor in one layout of a world, as the top view draws it."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

from lira.hal.errors import ConfigError
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.layout import Block, Mark, build, outline
from lira.sim_backend.polyline import Floats
from lira.tools.report.svg import Point

Outlines = tuple[tuple[Point, ...], ...]


@dataclass(frozen=True, slots=True)
class Course:
    """Metres in the world's frame. `way` is where to go where no paint shows it; `hanging` boxes are off the floor."""

    line: tuple[Point, ...] = ()
    line_width_m: float = 0.1
    way: tuple[Point, ...] = ()
    boxes: Outlines = ()
    hanging: Outlines = ()
    marks: Outlines = ()


NOTHING = Course()


@lru_cache
def course(world_name: str, layout: int) -> Course:
    """Return the floor of a layout; nothing for a world that is not there any more (a user's own file)."""
    try:
        world = load_world(world_name)
    except ConfigError:
        return NOTHING
    floor = build(world, layout)
    # Without any line there is no way either, only a direction.
    hidden = world.line is not None and floor.hidden_way
    return Course(
        line=() if floor.paint is None else points(floor.paint),
        line_width_m=0.1 if world.line is None else world.line.width_m,
        way=points(floor.curve.points) if hidden else (),
        boxes=outlines(block for block in floor.blocks if not block.bottom_m),
        hanging=outlines(block for block in floor.blocks if block.bottom_m),
        marks=outlines(floor.marks),
    )


def outlines(pieces: Iterable[Block | Mark]) -> Outlines:
    """Return the corners of each."""
    return tuple(points(outline(piece)) for piece in pieces)


def points(rows: Floats) -> tuple[Point, ...]:
    """Turn an array [n, 2] into points."""
    return tuple((float(x), float(y)) for x, y in rows)
