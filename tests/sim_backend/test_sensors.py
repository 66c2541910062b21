import math

import cv2
import msgspec
import numpy as np
import pytest

from lira.hal.errors import ConfigError
from lira.hal.messages import CompressedImage
from lira.hal.messages.compression import PICTURE_LIMIT_BYTES, fit_jpeg
from lira.hal.profile import load_profile
from lira.sim_backend import drive
from lira.sim_backend.layout import build
from lira.sim_backend.lidar import beam_angles
from lira.sim_backend.scenes.base import Pose, View
from lira.sim_backend.scenes.bullet import BulletScene, projection_matrix, view_matrix
from lira.sim_backend.sensors import Sensors
from lira.sim_backend.world import Along, Box, Limits, Line, Piece, World

SIM = load_profile("thesis-sim")
ROSBOT = load_profile("rosbot2")
ROAD = Line(pieces=(Piece(straight_m=60.0),))


def replace(struct, **changes):
    return msgspec.structs.replace(struct, **changes)


def floor(*boxes, line=None):
    return build(World(description="", line=line, box=boxes, limits=Limits(lost_m=9.0, finish_m=50.0)))


@pytest.fixture(params=["sketch", "tiny"])
def sensors(request):
    opened = []

    def make(layout, profile=SIM, renderer=request.param, seed=0):
        opened.append(Sensors(profile, layout, renderer, seed))
        return opened[-1]

    yield make
    for each in opened:
        each.close()


def picture(sensors, x=0.0, y=0.0, yaw=0.0):
    sensors.forget()
    return sensors.read("camera", drive.motion(x, y, yaw), 0.0).data


def ranges(sensors, x=0.0, y=0.0, yaw=0.0):
    sensors.forget()
    return sensors.read("scan", drive.motion(x, y, yaw), 0.0).ranges


# Camera


def test_the_picture_has_the_profiles_size_and_is_gray(sensors):
    image = picture(sensors(floor(line=ROAD)))
    assert image.shape == (32, 32, 3)
    assert image.dtype == np.uint8
    assert (image[..., 0] == image[..., 1]).all()
    assert (image[..., 0] == image[..., 2]).all()


def test_sky_above_the_horizon_and_floor_below(sensors):
    image = picture(sensors(floor()))[..., 0]
    # The horizon is 0.26 rad above the middle of a view of 0.698 rad.
    horizon = 16 - 16 * math.tan(SIM.camera.pitch_rad) / math.tan(SIM.camera.vfov_rad / 2)
    assert (image[: math.floor(horizon)] == 230).all()
    assert (image[math.ceil(horizon) :] == 180).all()


@pytest.mark.parametrize("distance_m", [0.7, 1.0, 1.5, 2.0, 3.0, 5.0])
def test_a_black_box_on_the_line_is_as_black_as_the_line(sensors, distance_m):
    """The camera must really be fooled: no gray in the picture tells the box from the line."""
    front_m = distance_m - 0.225
    eye = sensors(floor(Box(x_m=distance_m, y_m=0.0), line=ROAD), oversized(SIM))
    with_box = picture(eye)[..., 0]
    without = picture(sensors(floor(line=ROAD), oversized(SIM)))[..., 0]
    box_only = picture(sensors(floor(Box(x_m=distance_m, y_m=0.0)), oversized(SIM)))[..., 0]
    assert set(np.unique(with_box)) <= {0, 180, 230}
    assert set(np.unique(without)) <= {0, 180, 230}
    on_box, on_line = box_only == 0, without == 0
    assert on_box.any()
    assert front_m > 0
    # The picture is the two blacks laid over each other, and nothing else: no edge, no shade, no shadow.
    assert ((with_box == 0) == (on_box | on_line)).all()


def oversized(profile):
    """Too large to be averaged, so that every pixel is a surface's own gray."""
    return replace(profile, camera=replace(profile.camera, width_px=200, height_px=120))


def test_the_box_is_as_black_as_the_line_after_averaging(sensors):
    image = picture(sensors(floor(Box(x_m=0.9, y_m=0.0), line=ROAD)))[..., 0]
    middle = image[:, 15:17]
    assert middle.min() == 0
    assert (middle[6:20] == 0).all()


def test_a_box_beside_the_line_is_seen(sensors):
    road = picture(sensors(floor(line=ROAD)))[..., 0]
    left = picture(sensors(floor(Box(x_m=2.0, y_m=0.8), line=ROAD)))[..., 0]
    changed = left != road
    assert changed[:, :15].sum() > 8
    assert not changed[:, 16:].any()


def test_the_line_is_seen_well_ahead_and_where_geometry_says(sensors):
    image = picture(sensors(floor(line=ROAD)), y=0.3)[..., 0]
    tan_wide, tan_high = math.tan(SIM.camera.hfov_rad / 2), math.tan(SIM.camera.vfov_rad / 2)
    for ahead_m in (0.6, 1.0, 2.0, 3.0):
        # In the camera's own axes, pitched down about its y.
        down, level = math.sin(SIM.camera.pitch_rad), math.cos(SIM.camera.pitch_rad)
        forward = (ahead_m - SIM.camera.x_m) * level + SIM.camera.z_m * down
        up = (ahead_m - SIM.camera.x_m) * down - SIM.camera.z_m * level
        column = 16 + 16 * (0.3 / forward) / tan_wide
        row = 16 - 16 * (up / forward) / tan_high
        around = image[math.floor(row), math.floor(column) - 1 : math.floor(column) + 2]
        assert around.min() < 180 - 20, ahead_m


def test_the_line_stays_connected_for_several_metres(sensors):
    image = picture(sensors(floor(line=ROAD)))[..., 0]
    horizon = 5
    assert (image[horizon + 2 :, 13:19].min(axis=1) < 165).all()


def test_grays_come_out_as_the_world_says(sensors):
    for gray in (1, 64, 127, 200, 255):
        eye = sensors(floor(Box(x_m=0.8, y_m=0.0, gray=gray)))
        assert picture(eye)[14, 16, 0] == gray


def test_the_projection_maps_the_edges_of_the_view_to_the_edges_of_the_picture():
    camera = SIM.camera
    projection = np.array(projection_matrix(View(camera, 32, 32))).reshape(4, 4).T
    corner = np.array([math.tan(camera.hfov_rad / 2), math.tan(camera.vfov_rad / 2), -1.0, 1.0])
    x, y, _, w = projection @ corner
    assert (x / w, y / w) == pytest.approx((1.0, 1.0))


def test_the_view_puts_what_is_ahead_in_the_middle():
    camera = SIM.camera
    view = np.array(view_matrix(View(camera, 32, 32), Pose(1.0, 2.0, 0.7))).reshape(4, 4).T
    assert view[:3, :3] @ view[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
    eye = np.array([1.0 + camera.x_m * math.cos(0.7), 2.0 + camera.x_m * math.sin(0.7), camera.z_m, 1.0])
    assert (view @ eye)[:3] == pytest.approx([0, 0, 0], abs=1e-12)
    level = math.cos(camera.pitch_rad)
    ahead = np.array([math.cos(0.7) * level, math.sin(0.7) * level, -math.sin(camera.pitch_rad), 0.0])
    assert (view @ ahead)[:3] == pytest.approx([0, 0, -1], abs=1e-12)
    left = np.array([-math.sin(0.7), math.cos(0.7), 0.0, 0.0])
    assert (view @ left)[:3] == pytest.approx([-1, 0, 0], abs=1e-12)


def test_jpeg_stays_below_what_fits_on_the_link():
    noise = np.random.default_rng(0).integers(0, 256, (480, 640)).astype(np.uint8)
    flat = np.full((480, 640), 100, np.uint8)
    assert len(fit_jpeg(noise)) <= PICTURE_LIMIT_BYTES
    assert len(fit_jpeg(flat)) < len(fit_jpeg(noise))


def test_the_rosbots_camera_travels_as_jpeg(sensors):
    image = sensors(floor(line=ROAD), ROSBOT).read("camera", drive.motion(0, 0, 0), 0.0)
    assert isinstance(image, CompressedImage)
    assert len(image.data) < 64_000
    decoded = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR)
    assert decoded.shape == (480, 640, 3)


def test_camera_noise_has_its_size_and_its_seed(sensors):
    noisy = replace(SIM, camera=replace(SIM.camera, noise_gray=5.0))
    first, again, other = (picture(sensors(floor(), noisy, seed=seed))[..., 0] for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()
    assert np.std(first[8:].astype(float)) == pytest.approx(5.0, rel=0.15)


def test_opengl_shows_the_same(sensors):
    layout = floor(Box(x_m=2.0, y_m=0.5, gray=90), Box(x_m=3.0, y_m=-1.0), line=ROAD)
    try:
        egl = sensors(layout, oversized(SIM), renderer="egl")
    except ConfigError as error:
        pytest.skip(str(error))
    other = sensors(layout, oversized(SIM))
    for pose in ((0.0, 0.0, 0.0), (0.2, 0.23, -0.3), (1.0, -0.4, 0.5)):
        a, b = (picture(each, *pose)[..., 0].astype(int) for each in (egl, other))
        assert (np.abs(a - b) > 2).mean() < 0.002, pose


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.0, 0.1, 0.1), (0.5, 0.4, -0.3)])
def test_left_and_right_look_alike(sensors, pose):
    eye = sensors(floor(Box(x_m=2.0, y_m=0.6), Box(x_m=2.0, y_m=-0.6), line=ROAD))
    x, y, yaw = pose
    assert (picture(eye, x, y, yaw) == picture(eye, x, -y, -yaw)[:, ::-1]).all()


def test_whichever_renderer_is_faster_is_chosen_for_large_pictures_only(sensors):
    assert sensors(floor(), SIM, "auto").drawer == "tiny"
    assert sensors(floor(), ROSBOT, "auto").drawer in {"tiny", "egl"}


def test_another_layout_shows_its_own_boxes_and_none_of_the_last(sensors):
    world = World(description="", line=ROAD, along=(Along(count=5, on=0.0),), limits=Limits(lost_m=9.0, finish_m=50.0))
    eye = sensors(build(world, 0))
    first, first_scan = picture(eye, x=5.0), ranges(eye, x=5.0)
    eye.arrange(build(world, 1), SIM)
    second = picture(eye, x=5.0)
    assert (first != second).any()
    assert (second == picture(sensors(build(world, 1)), x=5.0)).all()
    eye.arrange(build(world, 0), SIM)
    assert (picture(eye, x=5.0) == first).all()
    assert (ranges(eye, x=5.0) == first_scan).all()


# Lidar


def test_ranges_are_the_geometrys_within_millimetres(sensors):
    scan = sensors(floor(Box(x_m=2.0, y_m=0.0, width_m=1.0))).read("scan", drive.motion(0.2, 0.0, 0.0), 0.0)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    hit = np.abs(np.tan(angles) * (1.775 - 0.2)) < 0.499
    assert scan.ranges[hit] == pytest.approx((1.775 - 0.2) / np.cos(angles[hit]), abs=1e-3)
    assert np.isposinf(scan.ranges[np.abs(np.tan(angles) * (1.775 - 0.2)) > 0.501]).all()


def test_beams_run_counter_clockwise(sensors):
    scanned = ranges(sensors(floor(Box(x_m=1.0, y_m=1.0))))
    hit = np.flatnonzero(np.isfinite(scanned))
    assert hit.min() > 50  # to the left: positive angles, the upper half


def test_the_sector_includes_both_of_its_ends():
    angles, increment = beam_angles(SIM.lidar), SIM.lidar.increment_rad
    assert len(angles) == 101
    assert (angles[0], angles[-1]) == pytest.approx((-SIM.lidar.fov_rad / 2, SIM.lidar.fov_rad / 2))
    assert math.degrees(increment) == pytest.approx(1.3, abs=1e-4)
    assert angles[50] == pytest.approx(0.0)


def test_a_full_turn_has_no_beam_twice():
    angles, increment = beam_angles(ROSBOT.lidar), ROSBOT.lidar.increment_rad
    assert angles[0] == pytest.approx(-math.pi)
    assert angles[-1] + increment == pytest.approx(math.pi)


def test_the_lidar_stands_where_the_profile_says(sensors):
    forward = replace(SIM, lidar=replace(SIM.lidar, x_m=0.1))
    layout = floor(Box(x_m=2.0, y_m=0.0))
    assert ranges(sensors(layout, forward))[50] == pytest.approx(1.675, abs=1e-3)
    turned = ranges(sensors(layout, forward), x=2.0, y=-2.0, yaw=math.pi / 2)
    assert turned[50] == pytest.approx(1.675, abs=1e-3)


def test_beams_pass_above_what_is_lower_than_the_lidar(sensors):
    assert np.isposinf(ranges(sensors(floor(Box(x_m=1.0, y_m=0.0, height_m=0.25))))).all()
    assert np.isfinite(ranges(sensors(floor(Box(x_m=1.0, y_m=0.0, height_m=0.27))))).any()


def test_no_return_and_too_close(sensors):
    assert np.isposinf(ranges(sensors(floor(Box(x_m=4.3, y_m=0.0))))).all()
    near = replace(SIM, lidar=replace(SIM.lidar, range_min_m=0.5))
    assert np.isneginf(ranges(sensors(floor(Box(x_m=0.6, y_m=0.0)), near))[50])


def test_noise_and_dropout_have_their_size_and_their_seed(sensors):
    spoiled = replace(SIM, lidar=replace(SIM.lidar, noise_m=0.01, dropout=0.2))
    wall = floor(Box(x_m=2.0, y_m=0.0, length_m=0.1, width_m=30.0))
    clean = ranges(sensors(wall))
    first, again, other = (
        np.array([sensors_.read("scan", drive.motion(0, 0, 0), t).ranges for t in range(20)])
        for sensors_ in (sensors(wall, spoiled, seed=s) for s in (1, 1, 2))
    )
    assert np.array_equal(first, again, equal_nan=True)
    assert not np.array_equal(first, other, equal_nan=True)
    assert np.isnan(first).mean() == pytest.approx(0.2, abs=0.03)
    middle = slice(20, 81)
    assert np.nanstd(first[:, middle] - clean[middle]) == pytest.approx(0.01, rel=0.1)


def test_every_scene_has_a_client_of_its_own():
    one, two = BulletScene(floor(Box(x_m=1.0, y_m=0.0))), BulletScene(floor())
    assert one.client != two.client
    one.close()
    one.close()
    two.close()
