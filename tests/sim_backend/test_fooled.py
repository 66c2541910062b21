"""Where the thesis has a sensor fooled it must really be fooled, and nowhere else."""

import math

import msgspec
import numpy as np
import pytest

from lira.fusion.modalities.depth import near_depth
from lira.fusion.modalities.image import gray_image, to_uint8
from lira.fusion.modalities.scan import bin_scan
from lira.hal.messages import Command, Twist
from lira.hal.profile import load_profile
from lira.sim_backend import drive
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.layout import build
from lira.sim_backend.sensors import Sensors
from lira.sim_backend.twin import Twin
from lira.sim_backend.world import Box, Limits, Line, Patch, Piece, Start, World

SIM = load_profile("thesis-sim")
ROSBOT = load_profile("rosbot2")
QUIET_ROSBOT = msgspec.structs.replace(
    ROSBOT,
    camera=msgspec.structs.replace(ROSBOT.camera, noise_gray=0.0),
    lidar=msgspec.structs.replace(ROSBOT.lidar, noise_m=0.0, dropout=0.0),
)


@pytest.fixture(params=["sketch", "tiny"])
def look(request):
    """What the networks see at a pose of a world: gray levels uint8 [32, 32] and normalised ranges [bins]."""
    opened = {}

    def look(world, pose, profile=SIM, layout=0):
        key = (msgspec.json.encode(world), layout, profile.name)
        if key not in opened:
            opened[key] = Sensors(profile, build(world, layout), request.param, 0)
        sensors = opened[key]
        sensors.forget()
        motion = drive.motion(*pose)
        image = to_uint8(gray_image(sensors.read("camera", motion, 0.0), profile.features.image_px)).astype(int)
        scan, _ = bin_scan(sensors.read("scan", motion, 0.0), profile.features)
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


# corridor: the camera is fooled, the lidar is not

CORRIDOR = load_world("corridor")
NEAR_EDGE_M = 8.0


def hallway(*, block=False, spot=False):
    """The corridor with one foam block, or one spot, that begins at NEAR_EDGE_M in the middle."""
    (kind,) = CORRIDOR.along
    size_m, (length_m, width_m) = kind.size_m, kind.fake_m
    boxes = (
        Box(
            x_m=NEAR_EDGE_M + size_m / 2,
            y_m=0.0,
            length_m=size_m,
            width_m=size_m,
            height_m=kind.height_m,
            gray=kind.gray,
        ),
    )
    spots = (Patch(x_m=NEAR_EDGE_M + length_m / 2, y_m=0.0, length_m=length_m, width_m=width_m, gray=kind.gray),)
    return msgspec.structs.replace(
        CORRIDOR, along=(), box=CORRIDOR.box + (boxes if block else ()), patch=spots if spot else ()
    )


@pytest.mark.parametrize("distance_m", [0.7, 1.0, 1.5, 2.0, 2.5])
def test_a_foam_block_and_a_white_spot_look_alike(look, distance_m):
    pose = (NEAR_EDGE_M - distance_m, 0.1, 0.0)
    empty = look(hallway(), pose)[0]
    block, spot = (look(hallway(**{kind: True}), pose)[0] - empty for kind in ("block", "spot"))
    assert min(block.min(), spot.min()) >= 0
    # They begin in the same row, where the robot would meet them, and share much of what they make white.
    lowest = [np.flatnonzero((each > 40).any(axis=1)).max() for each in (block, spot)]
    assert lowest[0] == lowest[1]
    assert np.minimum(block, spot).sum() >= 0.4 * np.maximum(block, spot).sum()


@pytest.mark.parametrize("distance_m", [0.7, 1.0, 1.5])
def test_foam_and_paint_are_of_one_gray(look, distance_m):
    pose = (NEAR_EDGE_M - distance_m, 0.1, 0.0)
    assert [look(hallway(**{kind: True}), pose)[0].max() for kind in ("block", "spot")] == [250, 250]


@pytest.mark.parametrize("profile", [SIM, QUIET_ROSBOT], ids=lambda profile: profile.name)
@pytest.mark.parametrize("distance_m", [0.5, 0.7, 0.9])
def test_the_lidar_tells_a_foam_block_from_a_white_spot(look, profile, distance_m):
    pose = (NEAR_EDGE_M - distance_m, 0.0, 0.0)
    block, spot, empty = (
        look(world, pose, profile)[1] for world in (hallway(block=True), hallway(spot=True), hallway())
    )
    assert (spot == empty).all()
    ahead_m = block[profile.features.bins // 2] * profile.features.max_range_m
    assert ahead_m == pytest.approx(distance_m - profile.lidar.x_m, abs=0.01)


def test_the_robot_drives_over_a_spot_and_into_a_block():
    assert not drive_straight(hallway(spot=True), NEAR_EDGE_M - 1.0, 0.0).collided
    assert drive_straight(hallway(block=True), NEAR_EDGE_M - 1.0, 0.0).collided


# garden: the camera is nearly fooled, the lidar is not

GARDEN = load_world("garden")
EMPTY_GARDEN = load_world("garden-train")
BOX_X_M, BOX_Y_M = 5.0, 0.15


def repainted(gray):
    """The garden with its box and the box's edge in another gray."""
    at_box = [box.x_m == BOX_X_M and box.y_m == BOX_Y_M for box in GARDEN.box]
    assert sum(at_box) == 2
    boxes = tuple(
        msgspec.structs.replace(box, gray=gray) if at else box for box, at in zip(GARDEN.box, at_box, strict=True)
    )
    return msgspec.structs.replace(GARDEN, box=boxes)


def test_the_gardens_differ_in_the_box_alone():
    less = without(GARDEN, lambda box: (box.x_m, box.y_m) == (BOX_X_M, BOX_Y_M))
    described = msgspec.structs.replace(EMPTY_GARDEN, name=less.name, description=less.description)
    assert described == less


@pytest.mark.parametrize("distance_m", [0.6, 1.0, 1.5, 2.0, 3.0])
def test_the_white_box_blends_with_the_tiles(look, distance_m):
    pose = (BOX_X_M - 0.15 - distance_m, 0.0, 0.0)
    white, nothing, black = (look(world, pose)[0] for world in (GARDEN, EMPTY_GARDEN, repainted(0)))
    seen, would_be_seen = np.abs(white - nothing), np.abs(black - nothing)
    assert would_be_seen.max() >= 150
    # No pixel changes by more than a joint between two tiles makes, the picture by a fraction of what a black box does.
    assert seen.max() <= 30
    assert seen.sum() < 0.1 * would_be_seen.sum()


@pytest.mark.parametrize("distance_m", [0.5, 0.7, 1.0])
def test_the_front_of_the_white_box_is_exactly_as_gray_as_the_tiles(look, distance_m):
    pose = (BOX_X_M - 0.15 - distance_m, BOX_Y_M, 0.0)
    white, black = (look(world, pose)[0] for world in (GARDEN, repainted(0)))
    on_box = black == 0
    on_box[: np.flatnonzero(on_box.any(axis=1)).min() + 2] = False  # the rows of its purple edge
    assert on_box.sum() >= 10
    assert (white[on_box] == GARDEN.ground_gray).all()


@pytest.mark.parametrize("profile", [SIM, QUIET_ROSBOT], ids=lambda profile: profile.name)
def test_the_lidar_sees_the_white_box_and_no_wall(look, profile):
    pose = (BOX_X_M - 0.15 - 0.9, BOX_Y_M, 0.0)
    box, nothing = (look(world, pose, profile)[1] for world in (GARDEN, EMPTY_GARDEN))
    assert (nothing == 1.0).all()
    ahead_m = box[profile.features.bins // 2] * profile.features.max_range_m
    assert ahead_m == pytest.approx(0.9 - profile.lidar.x_m, abs=0.01)


@pytest.mark.parametrize("progress_m", [0.0, 4.0, 8.0, 9.5, 13.0])
def test_the_steel_edge_is_seen_to_the_right(look, progress_m):
    image, _ = look(EMPTY_GARDEN, build(GARDEN).curve.pose(progress_m))
    lower = image[20:]
    assert (lower.min(axis=1) < 170).all()  # darker than any joint
    assert (lower.argmin(axis=1) >= 17).all()


# Black on black: the boxes on the lines


@pytest.mark.parametrize("name", ["line-obstacles", "eight-obstacles", "race"])
def test_boxes_on_a_line_have_its_gray(name):
    world = load_world(name)
    assert {block.gray for block in build(world).blocks} == {world.line.gray}


@pytest.mark.parametrize("name", ["line-obstacles", "eight-obstacles"])
@pytest.mark.parametrize("distance_m", [0.6, 1.0, 1.5])
def test_a_box_on_the_line_is_black_where_the_line_is_black(look, name, distance_m):
    """Nothing of the line turns lighter by the box in front of it."""
    world = load_world(name)
    layout = build(world)
    block = layout.blocks[0]
    at_m, _, _ = layout.curve.project(np.array([block.x_m, block.y_m]))
    pose = layout.curve.pose(float(at_m) - block.length_m / 2 - distance_m)
    boxed, plain = (look(each, pose)[0] for each in (world, msgspec.structs.replace(world, along=())))
    assert boxed.min() == 0
    assert (boxed <= plain + 1)[plain < 170].all()
    assert ((boxed == 0) & (plain < 170)).sum() >= 3


# table-top: the lidar is fooled, and so is the camera; depth is not

SEES_DEPTH = load_profile("thesis-sim-depth")
TABLE_TOPS = load_world("table-top")
FRONT_M = 4.0


def hung(*, top=False, box=False, line=True):
    """The world of table tops with one of them across its line, or one of its boxes, or nothing."""
    (kind,) = TABLE_TOPS.along
    place = {"x_m": FRONT_M + kind.size_m / 2, "y_m": 0.0, "length_m": kind.size_m, "width_m": kind.size_m}
    tops = (Box(**place, bottom_m=kind.tops_m[0], height_m=kind.tops_m[1], gray=kind.tops_gray),)
    boxes = (Box(**place, height_m=kind.size_m, gray=kind.gray),)
    drawn = TABLE_TOPS.line if line else None
    limits = TABLE_TOPS.limits if line else Limits(lost_m=2.0, finish_m=9.0)
    hanging = (tops if top else ()) + (boxes if box else ())
    return msgspec.structs.replace(TABLE_TOPS, along=(), box=hanging, line=drawn, limits=limits)


def depth_before(world, distance_m, renderer="tiny"):
    """What the networks see of the depth that far before the front: float32 [32, 32]."""
    sensors = Sensors(SEES_DEPTH, build(world, 0), renderer, 0)
    try:
        seen = sensors.read("depth", drive.motion(FRONT_M - distance_m, 0.0, 0.0), 0.0)
    finally:
        sensors.close()
    return near_depth(seen, SEES_DEPTH.features.image_px, 4.0)


def test_in_the_world_of_table_tops_half_of_what_is_in_the_way_hangs_in_every_layout():
    for layout in range(4):
        blocks = build(TABLE_TOPS, layout).blocks
        tops = [block for block in blocks if block.bottom_m > 0.0]
        assert (len(blocks), len(tops)) == (8, 4)
        assert all(block.in_the_way for block in blocks)
        for top in tops:
            assert SEES_DEPTH.lidar.z_m < top.bottom_m < top.bottom_m + top.height_m < SEES_DEPTH.camera.z_m
            assert top.gray == TABLE_TOPS.ground_gray


@pytest.mark.parametrize("distance_m", [0.4, 0.8, 1.5, 3.0])
def test_the_lidar_looks_below_a_table_top(look, distance_m):
    pose = (FRONT_M - distance_m, 0.0, 0.0)
    top, box, nothing = (look(each, pose)[1] for each in (hung(top=True), hung(box=True), hung()))
    assert (top == nothing).all()
    assert not (box == nothing).all()


@pytest.mark.parametrize("distance_m", [0.4, 0.8, 1.5, 3.0])
def test_the_camera_cannot_tell_a_table_top_from_the_floor(look, distance_m):
    pose = (FRONT_M - distance_m, 0.0, 0.0)
    bare = {"top": hung(top=True, line=False), "nothing": hung(line=False)}
    assert (look(bare["top"], pose)[0] == look(bare["nothing"], pose)[0]).all()
    # Where there is a line it hides a little of what is far ahead: nothing beside what a black box does.
    top, box, nothing = (look(each, pose)[0] for each in (hung(top=True), hung(box=True), hung()))
    assert np.abs(top - nothing).sum() < 0.06 * np.abs(box - nothing).sum()


@pytest.mark.parametrize("renderer", ["tiny", "sketch"])
@pytest.mark.parametrize("distance_m", [0.4, 0.8, 1.5, 3.0])
def test_depth_sees_how_far_a_table_top_is(distance_m, renderer):
    top, nothing = (depth_before(each, distance_m, renderer) for each in (hung(top=True), hung()))
    changed = top < nothing - 0.05
    assert changed[:, 15:17].any()
    seen_m = top[changed].min() * 4.0
    along_m = (distance_m - SEES_DEPTH.camera.x_m) * math.cos(SEES_DEPTH.camera.pitch_rad)  # its optical axis
    assert seen_m == pytest.approx(along_m, abs=0.02)


def test_who_drives_on_hits_the_table_top():
    assert drive_straight(hung(top=True, line=False), FRONT_M - 1.0, 0.0).collided
    assert not drive_straight(hung(line=False), FRONT_M - 1.0, 0.0).collided


# Paint


def test_later_paint_covers_earlier_paint_and_the_line_covers_all(look):
    road = Line(pieces=(Piece(straight_m=20.0),), width_m=0.2, gray=10)
    wide = Patch(x_m=6.0, y_m=0.0, length_m=10.0, width_m=3.0, gray=250)
    narrow = Patch(x_m=6.0, y_m=0.0, length_m=10.0, width_m=1.5, gray=90)
    limits = Limits(lost_m=2.0, finish_m=9.0)
    image = look(World(description="", limits=limits, line=road, patch=(wide, narrow)), (2.0, 0.0, 0.0))[0]
    for ahead_m in (0.6, 1.0, 1.5):
        down = math.floor(row(SIM.camera, ahead_m, 0.0))
        depth_m = ahead_m / math.cos(SIM.camera.pitch_rad)
        edge = [column(SIM.camera, math.atan2(y, depth_m)) for y in (0.4, 1.1)]
        assert [image[down, at] for at in edge] == [90, 250]
        assert image[down, 15:17].min() < 60
    reverse = look(World(description="", limits=limits, line=road, patch=(narrow, wide)), (2.0, 0.0, 0.0))[0]
    assert not (reverse[20:] == 90).any()
