"""How a world or a robot differs from the one that was taught in: applied when a novice is tried, never before.

Each shift is one thing, of a size that a user meets: another floor, other boxes, tighter bends, worse sensors, a camera
that was mounted anew, wheels that slip.
"""

from collections.abc import Callable

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
SLIP_AHEAD, SLIP_TURN = 0.95, 0.8  # of what the wheels are told


def gray(world: World, profile: RobotProfile) -> Place:
    """Other gray levels: what blends with the line still does."""

    def lighter(level: int) -> int:
        return min(255, level + BLACK)

    return replace(
        world,
        ground_gray=max(0, world.ground_gray + GROUND),
        sky_gray=max(0, world.sky_gray + SKY),
        line=world.line and replace(world.line, gray=lighter(world.line.gray)),
        box=tuple(replace(each, gray=lighter(each.gray)) for each in world.box),
        along=tuple(replace(each, gray=lighter(each.gray)) for each in world.along),
        area=tuple(replace(each, gray=lighter(each.gray)) for each in world.area),
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


def noise(world: World, profile: RobotProfile) -> Place:
    """Noise in the picture and in the ranges, and beams that read nothing."""
    camera = replace(profile.camera, noise_gray=max(NOISE_GRAY, profile.camera.noise_gray))
    lidar = profile.lidar
    lidar = replace(lidar, noise_m=max(NOISE_M, lidar.noise_m), dropout=max(DROPOUT, lidar.dropout))
    return world, replace(profile, camera=camera, lidar=lidar)


def camera(world: World, profile: RobotProfile) -> Place:
    """A camera a little higher that looks a little further down."""
    there = profile.camera
    there = replace(there, pitch_rad=there.pitch_rad + PITCH_RAD, z_m=there.z_m + HEIGHT_M)
    return world, replace(profile, camera=there)


def slip(world: World, profile: RobotProfile) -> Place:
    """Wheels that slip: an action moves the robot less than where it was taught."""
    base = profile.base
    base = replace(
        base,
        max_linear_m_s=SLIP_AHEAD * base.max_linear_m_s,
        max_angular_rad_s=SLIP_TURN * base.max_angular_rad_s,
    )
    return world, replace(profile, base=base)


SHIFTS: dict[str, Callable[[World, RobotProfile], Place]] = {
    each.__name__: each for each in (gray, boxes, curvature, noise, camera, slip)
}


def shifted(shift: str | None, world: World, profile: RobotProfile) -> Place:
    """Apply a shift by its name; None changes nothing."""
    return (world, profile) if shift is None else SHIFTS[shift](world, profile)
