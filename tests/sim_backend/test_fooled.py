"""Where the thesis has a sensor fooled it must really be fooled, and nowhere else."""

import math

import msgspec
import numpy as np
import pytest

from fusion.preprocess import bin_scan, gray_image, to_uint8
from hal.messages import Command, Twist
from hal.profile import load_profile
from sim_backend import drive
from sim_backend.catalogue import load_world
from sim_backend.layout import build
from sim_backend.sensors import Sensors
from sim_backend.twin import Twin
from sim_backend.world import Box, Limits, Start, World

SIM = load_profile("thesis-sim")
ROSBOT = load_profile("rosbot2")
QUIET_ROSBOT = msgspec.structs.replace(
    ROSBOT,
    camera=msgspec.structs.replace(ROSBOT.camera, noise_gray=0.0),
    lidar=msgspec.structs.replace(ROSBOT.lidar, noise_m=0.0, dropout=0.0),
)


@pytest.fixture
def look():
    """What the networks see at a pose of a world: gray levels uint8 [32, 32] and normalised ranges [bins]."""
    opened = {}

    def look(world, pose, profile=SIM, layout=0):
        key = (msgspec.json.encode(world), layout, profile.name)
        if key not in opened:
            opened[key] = Sensors(profile, build(world, layout), "tiny", 0)
        sensors = opened[key]
        sensors.forget()
        motion = drive.motion(*pose)
        image = to_uint8(gray_image(sensors.image(motion, 0.0), profile.features.image_px)).astype(int)
        scan, _ = bin_scan(sensors.scan(motion, 0.0), profile.features)
        return image, scan

    yield look
    for sensors in opened.values():
        sensors.close()


def bearing(pose, x, y):
    """Angle to a point on the floor, from the robot's x, counter-clockwise."""
    return math.remainder(math.atan2(y - pose[1], x - pose[0]) - pose[2], math.tau)


def column(camera, angle):
    """Column of the 32 that looks into a direction."""
    return math.floor(16 - 16 * math.tan(angle) / math.tan(camera.hfov_rad / 2))


def row(camera, ahead_m, z_m):
    """Row of the 32, not rounded, that shows a height at a distance straight ahead."""
    angle = math.atan2(z_m - camera.z_m, ahead_m) + camera.pitch_rad
    return 16 - 16 * math.tan(angle) / math.tan(camera.vfov_rad / 2)


def without(world, wanted):
    """The world less the boxes that `wanted` names."""
    return msgspec.structs.replace(world, box=tuple(box for box in world.box if not wanted(box)))


# passage: the lidar is fooled, the camera is not

PASSAGE = load_world("passage")
NO_LINTEL = without(PASSAGE, lambda box: box.bottom_m > 0.0)
BEFORE_THE_GAP = [(2.5, 0.0, 0.0), (3.5, 0.0, 0.1), (4.0, 0.55, 0.0), (4.6, 0.3, 0.2), (5.2, 0.55, 0.0)]
LINTEL_Y_M, WALL_X_M = 0.55, 5.9


@pytest.mark.parametrize("profile", [SIM, QUIET_ROSBOT], ids=lambda profile: profile.name)
@pytest.mark.parametrize("pose", BEFORE_THE_GAP)
def test_the_lidar_takes_the_closed_gap_for_an_open_one(look, profile, pose):
    closed, opened = (look(world, pose, profile)[1] for world in (PASSAGE, NO_LINTEL))
    assert (closed == opened).all()
    shape = profile.features
    ahead = round((bearing(pose, WALL_X_M, LINTEL_Y_M) / shape.fov_rad + 0.5) * (shape.bins - 1))
    assert closed[ahead] == 1.0


@pytest.mark.parametrize("profile", [SIM, QUIET_ROSBOT], ids=lambda profile: profile.name)
@pytest.mark.parametrize("pose", BEFORE_THE_GAP)
def test_the_camera_sees_that_the_gap_is_closed(look, profile, pose):
    closed, opened = (look(world, pose, profile)[0] for world in (PASSAGE, NO_LINTEL))
    gap = column(profile.camera, bearing(pose, WALL_X_M, LINTEL_Y_M))
    darker = (opened - closed)[:, gap] > 60
    assert darker.sum() >= 3
    # What closes it is as gray as the walls: one wall without a gap, but for the rows of its edges.
    assert (closed[np.flatnonzero(darker)[1:-1], gap] == 60).all()


def drive_straight(world, x_m, y_m, profile=SIM, distance_m=2.0):
    """Put the robot down at (x, y), let it drive straight on, and return what became of it."""
    twin = Twin(profile, msgspec.structs.replace(world, line=None, start=Start(x_m=x_m, y_m=y_m)))
    speed_m_s = profile.base.max_linear_m_s
    while twin.now() < distance_m / speed_m_s:
        twin.drive(Command(Twist(speed_m_s, 0.0), twin.now()))
        twin.wait(twin.now() + 0.2)
    return twin.state()


def test_who_drives_into_the_closed_gap_hits_the_lintel():
    state = drive_straight(PASSAGE, 4.5, LINTEL_Y_M)
    assert state.collided
    assert state.x_m < WALL_X_M
    assert not drive_straight(NO_LINTEL, 4.5, LINTEL_Y_M).collided
    assert not drive_straight(PASSAGE, 4.5, -1.5).collided


def test_what_hangs_above_the_robot_does_not_stop_it():
    higher = tuple(msgspec.structs.replace(box, bottom_m=0.3) if box.bottom_m else box for box in PASSAGE.box)
    assert not drive_straight(msgspec.structs.replace(PASSAGE, box=higher), 4.5, LINTEL_Y_M).collided


def test_what_hangs_is_seen_where_it_hangs(look):
    """The floor shows below it, the sky above it."""
    front_m = 2.0 - 0.05 - SIM.camera.x_m
    for bottom_m, height_m in ((0.34, 0.03), (0.1, 0.05)):
        bar = Box(x_m=2.0, y_m=0.0, length_m=0.1, width_m=2.0, bottom_m=bottom_m, height_m=height_m, gray=0)
        world = World(description="", limits=Limits(lost_m=2.0, finish_m=9.0), box=(bar,))
        middle = look(world, (0.0, 0.0, 0.0))[0][:, 16]
        plain = look(msgspec.structs.replace(world, box=()), (0.0, 0.0, 0.0))[0][:, 16]
        changed = np.flatnonzero(middle != plain)
        low, high = (row(SIM.camera, front_m, z_m) for z_m in (bottom_m, bottom_m + height_m))
        assert changed.min() == math.floor(high)
        # The lower side of a bar above the camera is seen behind its front.
        assert math.floor(low) - 1 <= changed.max() <= math.floor(low)
