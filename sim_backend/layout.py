"""One concrete floor: the line as a curve and every box in its place, drawn from a world and a layout seed."""

import math
from dataclasses import dataclass

import numpy as np

from lira.hal.errors import ConfigError
from lira.sim_backend.polyline import Floats, Polyline, resample
from lira.sim_backend.world import CLOSING_DEG, CLOSING_M, Along, Area, Box, Line, Patch, Start, Tiles, World

DRAWN_STEP_M = 0.02
# Nothing random stands nearer than this to the start, nothing at all nearer than a robot's size.
CLEAR_OF_START_M = 2.0
ROBOT_M = 0.3
# What begins above the highest sensor of any robot is not in its way.
ROBOT_HEIGHT_M = 0.30
ATTEMPTS = 400
TRIES_PER_X = 40


@dataclass(frozen=True, slots=True)
class Block:
    """A box in SI units: centre on the floor, yaw, edges along its own axes, gray, free room below it."""

    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    height_m: float
    gray: int
    bottom_m: float = 0.0

    @property
    def in_the_way(self) -> bool:
        """Whether the robot would touch it: it begins below the top of the robot's sensors."""
        return self.bottom_m < ROBOT_HEIGHT_M


@dataclass(frozen=True, slots=True)
class Mark:
    """A rectangle painted on the floor, in SI units."""

    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    gray: int


@dataclass(frozen=True, slots=True)
class Layout:
    """What the twin is built from. Without a line `curve` is the straight ahead of the start, and is not painted.

    Of marks that overlap the later one is seen, and the line over all of them.
    """

    world: World
    seed: int
    curve: Polyline
    blocks: tuple[Block, ...]
    marks: tuple[Mark, ...] = ()

    @property
    def paint(self) -> Floats | None:
        """Middle of the painted line, points [n, 2]; None where there is none."""
        line = self.world.line
        if line is None or not line.painted:
            return None
        headings = self.curve.headings
        painted: Floats = self.curve.points + line.offset_m * np.stack([-np.sin(headings), np.cos(headings)], axis=-1)
        return painted

    @property
    def hidden_way(self) -> bool:
        """Whether the way to go is anywhere but on a painted line."""
        return self.paint is None or (self.world.line is not None and self.world.line.offset_m != 0.0)


def build(world: World, layout_seed: int = 0) -> Layout:
    """Draw a layout. The same world and seed give the same boxes; every scatter draws from its own stream.

    Raises `ConfigError` if the boxes of a scatter do not fit.
    """
    if layout_seed < 0:
        raise ConfigError(f"layout {layout_seed} is negative", "Layouts are numbered from 0.")
    curve = course_curve(world)
    blocks = [to_block(box) for box in world.box]
    marks = [joint for tiles in world.tiles for joint in to_joints(tiles)] + [to_mark(patch) for patch in world.patch]
    for number, along in enumerate(world.along):
        stream = np.random.default_rng([layout_seed, 1, number])
        real, fake = scatter_along(curve, along, world.limits.finish_m, stream)
        blocks += real
        marks += fake
    start = (world.start.x_m, world.start.y_m)
    for number, area in enumerate(world.area):
        blocks += scatter_area(area, blocks, start, np.random.default_rng([layout_seed, 2, number]))
    return Layout(world, layout_seed, curve, tuple(blocks), tuple(marks))


def check(world: World) -> None:
    """Try a world out: raises `ValueError` or `ConfigError` for a line that does not close or a box on the start."""
    layout = build(world)
    x, y, _ = layout.curve.pose(0.0)
    for number, block in enumerate(layout.blocks):
        if block.in_the_way and distance_m(block, x, y) < ROBOT_M:
            raise ValueError(f"box {number + 1} at ({block.x_m:g}, {block.y_m:g}) stands on the start")


def course_curve(world: World) -> Polyline:
    """Return the line, or the straight ahead of the start. Raises `ValueError` if a closed line does not close."""
    if world.line is None:
        yaw = math.radians(world.start.yaw_deg)
        ahead = np.array([math.cos(yaw), math.sin(yaw)]) * (world.limits.finish_m or 1.0)
        return resample(np.array([world.start.x_m, world.start.y_m]) + np.outer([0.0, 1.0], ahead), closed=False)
    return resample(draw_line(world.line, world.start), world.line.closed)


def draw_line(line: Line, start: Start) -> Floats:
    """Lay the pieces end to end: points [m, 2]."""
    x, y, yaw = start.x_m, start.y_m, math.radians(start.yaw_deg)
    points = [np.array([[x, y]])]
    for piece in line.pieces * line.repeat:
        count = max(math.ceil(piece.length_m / DRAWN_STEP_M), 2)
        along = np.linspace(0.0, piece.length_m, count + 1)[1:]
        if piece.radius_m is None:
            part = np.stack([x + along * math.cos(yaw), y + along * math.sin(yaw)], axis=-1)
        else:
            radius = math.copysign(piece.radius_m, piece.angle_deg or 0.0)
            turned = yaw + along / radius
            part = np.stack(
                [x + radius * (np.sin(turned) - math.sin(yaw)), y - radius * (np.cos(turned) - math.cos(yaw))], axis=-1
            )
            yaw += math.radians(piece.angle_deg or 0.0)
        x, y = map(float, part[-1])
        points.append(part)
    if line.closed:
        gap = math.hypot(x - start.x_m, y - start.y_m)
        bend = abs(math.degrees(math.remainder(yaw - math.radians(start.yaw_deg), math.tau)))
        if gap > CLOSING_M or bend > CLOSING_DEG:
            raise ValueError(
                f"the line is said to be closed, but ends {gap:.2f} m and {bend:.1f} degrees off its beginning"
            )
        points[-1] = points[-1][:-1]  # the first point again, but for rounding
    return np.concatenate(points)


def to_block(box: Box) -> Block:
    """Leave degrees behind."""
    return Block(
        *(box.x_m, box.y_m, math.radians(box.yaw_deg)),
        *(box.length_m, box.width_m, box.height_m),
        *(box.gray, box.bottom_m),
    )


def to_mark(patch: Patch) -> Mark:
    """Leave degrees behind."""
    yaw_rad = math.radians(patch.yaw_deg)
    return Mark(patch.x_m, patch.y_m, yaw_rad, patch.length_m, patch.width_m, patch.gray)


def to_joints(tiles: Tiles) -> list[Mark]:
    """Lay the joints: those along y at every multiple of the size from `x_m`, and likewise."""
    (x0, x1), (y0, y1) = tiles.x_m, tiles.y_m
    size_m, joint_m, gray = tiles.size_m, tiles.joint_m, tiles.gray
    return [
        *(Mark(x, (y0 + y1) / 2, 0.0, joint_m, y1 - y0, gray) for x in np.arange(x0, x1 + joint_m, size_m).tolist()),
        *(Mark((x0 + x1) / 2, y, 0.0, x1 - x0, joint_m, gray) for y in np.arange(y0, y1 + joint_m, size_m).tolist()),
    ]


def standing(along: Along, at: tuple[float, float, float]) -> Block:
    """Make a box of a scatter at (x, y, yaw)."""
    return Block(*at, along.size_m, along.size_m, along.height_m or along.size_m, along.gray)


def table_top(along: Along, at: tuple[float, float, float]) -> Block:
    """Make a table top of a scatter at (x, y, yaw)."""
    bottom_m, thickness_m = along.tops_m
    return Block(*at, along.size_m, along.size_m, thickness_m, along.tops_gray, bottom_m)


def scatter_along(
    curve: Polyline, along: Along, finish_m: float | None, rng: np.random.Generator
) -> tuple[list[Block], list[Mark]]:
    """One box, or the fake of one, in each of `count` equal slots of the course, jittered as the spacing allows."""
    end_m = curve.length_m - along.clear_m if finish_m is None else min(finish_m, curve.length_m)
    free_m = end_m - along.clear_m
    slot_m = free_m / along.count
    if slot_m < along.spacing_m:
        raise ConfigError(
            f"{along.count} boxes {along.spacing_m:g} m apart do not fit on {free_m:.1f} m of line",
            "Lower along.count or along.spacing_m.",
        )
    beside = set(rng.permutation(along.count)[: round(along.count * (1.0 - along.on))].tolist())
    places = []
    for number in range(along.count):
        jitter_m = rng.uniform(-0.5, 0.5) * (slot_m - along.spacing_m)
        at_m = along.clear_m + (number + 0.5) * slot_m + jitter_m
        near_m, far_m = along.beside_m
        off_m = rng.choice([-1.0, 1.0]) * rng.uniform(near_m, far_m)
        on_m = rng.uniform(-1.0, 1.0) * along.on_lateral_m
        places.append(curve.pose(at_m, float(off_m if number in beside else on_m)))
    # Drawn last, so that fakes and tops leave the places as they are.
    drawn = rng.permutation(along.count).tolist()
    fakes = set(drawn[: round(along.count * along.fake)])
    tops = set(drawn[len(drawn) - round(along.count * along.tops) :])
    real = [(table_top if k in tops else standing)(along, at) for k, at in enumerate(places) if k not in fakes]
    fake = [Mark(*at, *along.fake_m, along.gray) for k, at in enumerate(places) if k in fakes]
    return real, fake


def scatter_area(area: Area, others: list[Block], start: tuple[float, float], rng: np.random.Generator) -> list[Block]:
    """Throw boxes until `count` stand free of each other, denser towards the far end."""
    blocks: list[Block] = []
    for _ in range(area.count):
        for attempt in range(ATTEMPTS):
            if attempt % TRIES_PER_X == 0:  # or crowded places would lose their boxes to empty ones
                x = area.x_m[0] + (area.x_m[1] - area.x_m[0]) * ramp(rng.uniform(), area.sparse)
            y = rng.uniform(*area.y_m)
            half_m = area.size_m / 2
            clear_of_start = math.hypot(x - start[0], y - start[1]) > CLEAR_OF_START_M + half_m
            # A circle around the new box is enough: the gap is a minimum.
            reach_m = half_m * math.sqrt(2.0) + area.gap_m
            if clear_of_start and all(distance_m(other, x, y) > reach_m for other in others + blocks):
                yaw_rad, height_m = rng.uniform(-math.pi, math.pi), area.height_m or area.size_m
                blocks.append(Block(x, y, yaw_rad, area.size_m, area.size_m, height_m, area.gray, area.bottom_m))
                break
        else:
            raise ConfigError(
                f"{area.count} boxes with {area.gap_m:g} m between them do not fit into the area",
                "Lower area.count or area.gap_m, or enlarge the area.",
            )
    return blocks


def ramp(uniform: float, sparse: float) -> float:
    """Turn a uniform draw into one whose density grows linearly over [0, 1] from `sparse` to 2 - `sparse`."""
    slope = 1.0 - sparse
    if slope < 1e-9:
        return uniform
    # Solve the cumulative distribution sparse t + slope t^2 = uniform for t.
    return (-sparse + math.sqrt(sparse * sparse + 4.0 * slope * uniform)) / (2.0 * slope)


def distance_m(block: Block, x_m: float, y_m: float) -> float:
    """Return the distance from a point to a block's outline, 0 inside."""
    dx, dy = x_m - block.x_m, y_m - block.y_m
    cos, sin = math.cos(block.yaw_rad), math.sin(block.yaw_rad)
    outside_x = abs(cos * dx + sin * dy) - block.length_m / 2
    outside_y = abs(cos * dy - sin * dx) - block.width_m / 2
    return math.hypot(max(outside_x, 0.0), max(outside_y, 0.0))


def outline(piece: Block | Mark) -> Floats:
    """Return the four corners on the floor, metres [4, 2]."""
    cos, sin = math.cos(piece.yaw_rad), math.sin(piece.yaw_rad)
    along = np.array([0.5, -0.5, -0.5, 0.5]) * piece.length_m
    across = np.array([0.5, 0.5, -0.5, -0.5]) * piece.width_m
    return np.stack([piece.x_m + cos * along - sin * across, piece.y_m + sin * along + cos * across], axis=-1)
