"""The sketch beside pybullet: the same floor, the same places, the same pictures and ranges."""

import math
from dataclasses import replace

import cv2
import msgspec
import numpy as np
import pytest

from lira.hal.profile import Depth, load_profile
from lira.sim_backend.camera import PinholeCamera
from lira.sim_backend.catalogue import known_worlds, load_world
from lira.sim_backend.course import Course, footprint_radius_m
from lira.sim_backend.layout import Layout, build
from lira.sim_backend.lidar import RayLidar
from lira.sim_backend.scenes.base import Pose
from lira.sim_backend.scenes.bullet import BulletScene
from lira.sim_backend.scenes.sketch import SketchScene
from lira.sim_backend.world import Box, Limits, World

PROFILES = {name: load_profile(name) for name in ("thesis-sim", "rosbot2")}
POSES = {"thesis-sim": 5, "rosbot2": 1}  # of each world and layout: a large picture takes pybullet longer
LAYOUTS = (0, 3)
# Of the pixels of a picture, as it is drawn, before it is averaged down.
MOST_PIXELS_APART = 0.001
# pybullet's rays end up to this far before what they meet, or miss it if it is thinner.
SKIN_M = 1.5e-3
DEPTH = Depth(width_px=160, height_px=120, range_min_m=0.3, range_max_m=8.0)


def places(layout: Layout, count: int, seed: int) -> list[Pose]:
    """Anywhere on and beside the way, in any heading, off the boxes."""
    course = Course(layout, footprint_radius_m(PROFILES["thesis-sim"].base))
    draw = np.random.default_rng(seed)
    way_m = course.limits.finish_m or layout.curve.length_m
    poses: list[Pose] = []
    while len(poses) < count:
        lateral_m, yaw_rad = draw.uniform(-1.2, 1.2), draw.choice([0.5, math.pi]) * draw.uniform(-1.0, 1.0)
        pose = Pose(*course.start_pose(draw.uniform(0.0, way_m), lateral_m, yaw_rad))
        if course.clearance(np.array(pose[:2])) > 0.0:
            poses.append(pose)
    return poses


@pytest.fixture(scope="module", params=[(world, layout) for world in known_worlds() for layout in LAYOUTS], ids=str)
def pair(request):
    world, number = request.param
    layout = build(load_world(world), number)
    bullet = BulletScene(layout)
    yield layout, bullet, SketchScene(layout)
    bullet.close()


def near_edges(picture):
    """Pixels beside an edge of a picture."""
    kernel = np.ones((3, 3), np.uint8)
    return cv2.dilate(picture, kernel) != cv2.erode(picture, kernel)


@pytest.mark.parametrize("name", PROFILES)
def test_pictures_differ_along_edges_only(pair, name):
    layout, bullet, sketch = pair
    view = PinholeCamera(PROFILES[name].camera, sketch).view
    for pose in places(layout, POSES[name], seed=layout.seed):
        theirs, ours = bullet.photograph(view, pose), sketch.photograph(view, pose)
        apart = theirs != ours
        assert apart.mean() < MOST_PIXELS_APART, pose
        assert not (apart & ~near_edges(ours) & ~near_edges(theirs)).any(), pose


@pytest.mark.parametrize("name", PROFILES)
def test_ranges_differ_by_pybullets_skin_only(pair, name):
    layout, bullet, sketch = pair
    lidar = RayLidar(PROFILES[name].lidar, sketch, np.random.default_rng(0))
    smaller, larger = (SketchScene(grown(layout, by_m)) for by_m in (-SKIN_M, SKIN_M))
    beams, off = 0, 0
    for pose in places(layout, 10, seed=layout.seed):
        fan = lidar.fan(pose)
        theirs, ours = bullet.ranges_m(*fan), sketch.ranges_m(*fan)
        assert (theirs >= larger.ranges_m(*fan) - SKIN_M).all(), pose
        assert (theirs <= smaller.ranges_m(*fan) + SKIN_M).all(), pose
        beams += len(ours)
        off += np.count_nonzero(~np.isclose(theirs, ours, rtol=0.0, atol=1e-3))
    assert off <= 0.005 * beams  # where a beam grazes a face


def grown(layout: Layout, by_m: float) -> Layout:
    """A floor with every box larger by so much on every side."""
    blocks = tuple(
        replace(
            block,
            length_m=block.length_m + 2 * by_m,
            width_m=block.width_m + 2 * by_m,
            height_m=block.height_m + 2 * by_m,
            bottom_m=block.bottom_m - by_m,
        )
        for block in layout.blocks
    )
    return replace(layout, blocks=blocks)


@pytest.mark.parametrize("name", PROFILES)
def test_depths_are_the_same_to_a_millimetre_but_along_edges(pair, name):
    layout, bullet, sketch = pair
    ours, theirs = (PinholeCamera(PROFILES[name].camera, scene) for scene in (sketch, bullet))
    for pose in places(layout, 3, seed=layout.seed):
        one, other = (camera.depth(DEPTH, pose).astype(int) for camera in (ours, theirs))
        assert (np.abs(one - other) > 1).mean() < 0.002, pose


def test_boxes_hide_each_other_as_they_stand():
    """Boxes of many grays and heights, some hanging over others: what is painted last is what is nearest."""
    draw = np.random.default_rng(1)
    boxes: list[Box] = []
    while len(boxes) < 40:
        box = Box(
            x_m=draw.uniform(0.8, 6.0),
            y_m=draw.uniform(-3.0, 3.0),
            yaw_deg=draw.uniform(-180.0, 180.0),
            length_m=draw.uniform(0.05, 0.9),
            width_m=draw.uniform(0.05, 0.9),
            height_m=draw.uniform(0.05, 0.2),
            bottom_m=draw.choice([0.0, 0.22, 0.45]),
            gray=int(draw.integers(0, 256)),
        )
        reach_m = [math.hypot(each.length_m, each.width_m) / 2 for each in (box, *boxes)]
        if all(
            each.bottom_m != box.bottom_m or math.hypot(each.x_m - box.x_m, each.y_m - box.y_m) > reach_m[0] + own_m
            for each, own_m in zip(boxes, reach_m[1:], strict=True)
        ):
            boxes.append(box)
    layout = build(World(description="", box=tuple(boxes), limits=Limits(lost_m=9.0, finish_m=50.0)))
    bullet, sketch = BulletScene(layout), SketchScene(layout)
    for camera in (PROFILES["thesis-sim"].camera, PROFILES["rosbot2"].camera):
        view = PinholeCamera(camera, sketch).view
        for yaw_rad in np.linspace(-0.6, 0.6, 7).tolist():
            pose = Pose(0.0, 0.0, yaw_rad)
            theirs, ours = bullet.photograph(view, pose), sketch.photograph(view, pose)
            assert len(np.unique(ours)) > 12
            assert (theirs != ours).mean() < 0.002, yaw_rad
    bullet.close()


def test_a_table_is_seen_by_depth_and_passed_below_by_the_lidar():
    """A plate on thin legs: camera and depth picture see it, the lidar's plane meets the legs alone."""
    legs = [Box(x_m=x, y_m=y, length_m=0.03, width_m=0.03, height_m=0.3) for x in (1.2, 1.8) for y in (-0.4, 0.4)]
    plate = Box(x_m=1.5, y_m=0.0, length_m=0.8, width_m=1.0, height_m=0.03, bottom_m=0.3, gray=90)
    layout = build(World(description="", box=(*legs, plate), limits=Limits(lost_m=9.0, finish_m=50.0)))
    rosbot, sketch, bullet = PROFILES["rosbot2"], SketchScene(layout), BulletScene(layout)
    lidar = RayLidar(rosbot.lidar, sketch, np.random.default_rng(0))
    assert np.isfinite(sketch.ranges_m(*lidar.fan(Pose(0.0, 0.0, 0.0)))).mean() < 0.05
    seen, theirs = (PinholeCamera(rosbot.camera, each).depth(DEPTH, Pose(0.0, 0.0, 0.0)) for each in (sketch, bullet))
    edge = seen[:, 80][:60]
    assert edge[edge > 0].min() == pytest.approx(1000 * (1.1 - rosbot.camera.x_m), abs=1)
    assert (np.abs(seen.astype(int) - theirs) > 1).mean() < 0.002
    bullet.close()


@pytest.mark.parametrize(
    ("height_m", "pitch_rad"), [(0.30, 1.2), (0.05, 0.0), (0.60, 0.5), (0.02, -0.3)], ids=lambda value: f"{value:g}"
)
def test_what_is_near_is_cut_off_and_not_turned_inside_out(height_m, pitch_rad):
    """A camera that looks down on what it stands over, and one that looks along a wall beside it."""
    world = load_world("line-obstacles")
    wall = Box(x_m=0.0, y_m=0.25, length_m=6.0, width_m=0.1, height_m=0.5, gray=120)
    layout = build(msgspec.structs.replace(world, box=(wall,)), 0)
    camera = msgspec.structs.replace(PROFILES["thesis-sim"].camera, z_m=height_m, pitch_rad=pitch_rad)
    bullet, sketch = BulletScene(layout), SketchScene(layout)
    view = PinholeCamera(camera, sketch).view
    for yaw_rad in (0.0, 0.4, 1.5, 3.0):
        pose = Pose(0.05, 0.02, yaw_rad)
        assert (bullet.photograph(view, pose) != sketch.photograph(view, pose)).mean() < 0.002, yaw_rad
    bullet.close()


def test_an_empty_floor_is_sky_and_ground():
    layout = build(World(description="", limits=Limits(lost_m=9.0, finish_m=50.0)))
    sketch = SketchScene(layout)
    view = PinholeCamera(PROFILES["thesis-sim"].camera, sketch).view
    assert set(np.unique(sketch.photograph(view, Pose(0.0, 0.0, 0.0)))) == {180, 230}
    assert np.isinf(sketch.ranges_m((0.0, 0.0, 0.2), np.linspace(-1.0, 1.0, 5), 4.0)).all()


def test_rays_along_a_face_and_beside_it():
    """Where a ray is parallel to a face, to the bit: it is between the two faces or it is not."""
    layout = build(World(description="", box=(Box(x_m=2.0, y_m=0.0),), limits=Limits(lost_m=9.0, finish_m=50.0)))
    sketch = SketchScene(layout)
    for y_m, expected_m in ((0.0, 1.775), (0.2, 1.775), (0.3, math.inf), (-3.0, math.inf)):
        assert sketch.ranges_m((0.0, y_m, 0.2), np.zeros(1), 4.0) == pytest.approx(expected_m)
    assert sketch.ranges_m((0.0, 0.0, 0.2), np.array([math.pi]), 4.0) == math.inf
    assert sketch.ranges_m((0.0, 0.0, 0.46), np.zeros(1), 4.0) == math.inf
    assert sketch.ranges_m((0.0, 0.0, 0.2), np.zeros(1), 1.7) == math.inf
