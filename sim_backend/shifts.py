"""How a world or a robot differs from the one that was taught in: another floor, other boxes, worse sensors, and so on.

Each shift is one thing, of a size that a user meets; some also by an `amount`: 1 is all of it, and -1, where there are
two ways to differ, as much the other way. A novice is tried under one of them; in a world that is `randomised` it is
taught under some of them at once, by other amounts in every layout (domain randomisation: Tobin et al., 2017).
"""

from collections.abc import Callable

import numpy as np
from msgspec.structs import replace

from lira.hal.errors import ConfigError
from lira.hal.profile import RobotProfile
from lira.sim_backend.world import Line, World

Place = tuple[World, RobotProfile]

GROUND, SKY, BLACK = -30, -20, 30  # gray levels: a darker floor, and black that is not quite
BOXES = 1.4  # times as large
BENDS = 0.75  # times the radius, and the length of all straights
NOISE_GRAY, NOISE_M, DROPOUT = 8.0, 0.02, 0.02
PITCH_RAD, HEIGHT_M = 0.05, 0.03
SLIP_AHEAD, SLIP_TURN = 0.05, 0.2  # of what the wheels are told, lost
STREAM = 3  # of a layout's draws; its boxes take 1 and 2


def gray(world: World, profile: RobotProfile, amount: float = 1.0) -> Place:
    """Other gray levels: what blends with the line still does."""

    def level(was: int, change: float) -> int:
        return min(255, max(0, was + round(amount * change)))

    return replace(
        world,
        ground_gray=level(world.ground_gray, GROUND),
        sky_gray=level(world.sky_gray, SKY),
        line=world.line and replace(world.line, gray=level(world.line.gray, BLACK)),
        box=tuple(replace(each, gray=level(each.gray, BLACK)) for each in world.box),
        along=tuple(replace(each, gray=level(each.gray, BLACK)) for each in world.along),
        area=tuple(replace(each, gray=level(each.gray, BLACK)) for each in world.area),
    ), profile


def boxes(world: World, profile: RobotProfile) -> Place:
    """Larger boxes, as high as before."""
    along = tuple(
        replace(each, size_m=BOXES * each.size_m, height_m=each.height_m or each.size_m) for each in world.along
    )
    box = tuple(replace(each, length_m=BOXES * each.length_m, width_m=BOXES * each.width_m) for each in world.box)
    area = tuple(replace(each, size_m=BOXES * each.size_m) for each in world.area)
    return replace(world, along=along, box=box, area=area), profile


def curvature(world: World, profile: RobotProfile) -> Place:
    """Tighter bends; all of the line shrinks, so that a closed one still closes. Raises `ConfigError` without one."""
    if world.line is None or world.box:
        raise ConfigError(
            f"the bends of {world.name} cannot be changed", "Take a world of a line and what is along it."
        )
    finish_m = world.limits.finish_m and BENDS * world.limits.finish_m
    return replace(world, line=_tighter(world.line), limits=replace(world.limits, finish_m=finish_m)), profile


def _tighter(line: Line) -> Line:
    pieces = tuple(
        replace(
            piece,
            straight_m=piece.straight_m and BENDS * piece.straight_m,
            radius_m=piece.radius_m and BENDS * piece.radius_m,
        )
        for piece in line.pieces
    )
    return replace(line, pieces=pieces)


def noise(world: World, profile: RobotProfile, amount: float = 1.0) -> Place:
    """Noise in the picture and in the ranges, and beams that read nothing."""
    camera, lidar = profile.camera, profile.lidar
    camera = replace(camera, noise_gray=max(amount * NOISE_GRAY, camera.noise_gray))
    lidar = replace(lidar, noise_m=max(amount * NOISE_M, lidar.noise_m), dropout=max(amount * DROPOUT, lidar.dropout))
    return world, replace(profile, camera=camera, lidar=lidar)


def camera(world: World, profile: RobotProfile, amount: float = 1.0) -> Place:
    """A camera a little higher that looks a little further down."""
    there = profile.camera
    there = replace(there, pitch_rad=there.pitch_rad + amount * PITCH_RAD, z_m=there.z_m + amount * HEIGHT_M)
    return world, replace(profile, camera=there)


def slip(world: World, profile: RobotProfile, amount: float = 1.0) -> Place:
    """Wheels that slip: an action moves the robot less than where it was taught."""
    base = profile.base
    base = replace(
        base,
        max_linear_m_s=(1.0 - amount * SLIP_AHEAD) * base.max_linear_m_s,
        max_angular_rad_s=(1.0 - amount * SLIP_TURN) * base.max_angular_rad_s,
    )
    return world, replace(profile, base=base)


SHIFTS: dict[str, Callable[[World, RobotProfile], Place]] = {
    each.__name__: each for each in (gray, boxes, curvature, noise, camera, slip)
}
DRAWN = ((gray, -1.0), (noise, 0.0), (camera, -1.0), (slip, 0.0))
"""What a randomised world draws, and the least amount of it; the most is 1."""


def shifted(shift: str | None, world: World, profile: RobotProfile) -> Place:
    """Apply a shift by its name; None changes nothing."""
    return (world, profile) if shift is None else SHIFTS[shift](world, profile)


def surroundings(world: World, profile: RobotProfile, layout: int) -> Place:
    """The world and the robot in a layout: as they are, or where the world is randomised, one draw for this layout."""
    if world.randomised:
        draws = np.random.default_rng([layout, STREAM])
        for shift, least in DRAWN:
            world, profile = shift(world, profile, float(draws.uniform(least, 1.0)))
    return world, profile
