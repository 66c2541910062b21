"""The robot as ROS sees it: a tree of frames as tf2 takes it, a model, what the camera projects, honest covariances."""

import math
import re
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tf_tree import TfBuffer
from wiring import joined, real_time_null, served, wait_for

from lira.hal.bus.topics import CAMERA, CAMERA_INFO, DESCRIPTION, IN_LOCKSTEP, ODOM, SCAN, TF, TF_STATIC
from lira.hal.clock import unix_offset_s
from lira.hal.description.camera_info import info_for, load_calibration, pinhole
from lira.hal.description.drift import Drift
from lira.hal.description.frames import odometry_transform, static_transforms
from lira.hal.description.urdf import urdf_of
from lira.hal.errors import ConfigError
from lira.hal.messages import DepthImage, Image, Imu, Odometry, Spread
from lira.hal.messages.compression import compress, compress_depth
from lira.hal.messages.images import size_of
from lira.hal.messages.ros.codec import CODECS, decode, encode
from lira.hal.profile import known_profiles, load_profile
from lira.hal.server.graph_publisher import GraphPublisher
from lira.hal.testing import NullRobot
from lira.robot.settings import load_camera_info

ROSBOT = load_profile("rosbot2")
CALIBRATION = """
image_width: 1280
image_height: 960
camera_name: astra
camera_matrix: {rows: 3, cols: 3, data: [1100.0, 0.0, 640.5, 0.0, 1110.0, 480.5, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, -0.2, 0.001, 0.002, 0.0]}
rectification_matrix: {rows: 3, cols: 3, data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}
projection_matrix: {rows: 3, cols: 4, data: [1090.0, 0.0, 640.5, 0.0, 0.0, 1100.0, 480.5, 0.0, 0.0, 0.0, 1.0, 0.0]}
"""


def odometry(stamp_s, x_m=0.0, y_m=0.0, yaw_rad=0.0):
    return Odometry(stamp_s, x_m, y_m, yaw_rad, 0.1, 0.2)


def tree_of(profile, odom):
    buffer = TfBuffer()
    buffer.add(as_ros(static_transforms(profile, 0.0)), static=True)
    buffer.add(as_ros(odometry_transform(odom)))
    return buffer


def as_ros(message):
    return CODECS[type(message)].to_ros(message)


@pytest.mark.parametrize("name", known_profiles())
def test_tf_has_one_root_and_each_frame_one_parent(name):
    profile = load_profile(name)
    buffer = tree_of(profile, odometry(5.0, 1.0, 2.0, math.pi / 2))
    assert buffer.roots() == {"odom"}
    frames = {"laser", "camera_link", "camera_optical_frame", "base_footprint", "base_link"}
    frames |= {each.frame_id for each in profile.ranger} | ({"imu_link"} if profile.imu else set())
    assert buffer.frames() == frames | {"odom"}


def test_tf_places_what_a_sensor_sees_where_it_is():
    buffer = tree_of(ROSBOT, odometry(5.0, 1.0, 2.0, math.pi / 2))  # it looks along y of odom
    assert buffer.transform("odom", "laser", (3.0, 0.0, 0.0)) == pytest.approx((1.0, 2.0 + 3.0 + 0.02, 0.134))
    # Optical: z ahead, x right, y down. Two metres ahead, half a metre to the right, 0.1 m down.
    seen = buffer.transform("base_link", "camera_optical_frame", (0.5, 0.1, 2.0))
    assert seen == pytest.approx((-0.014 + 2.0, -0.5, 0.201 - 0.1))
    behind = buffer.transform("base_link", "range_rl", (0.1, 0.0, 0.0))
    assert behind[0] < -0.18
    assert behind[1] > 0.05


def test_tf_of_a_camera_that_looks_down_meets_the_floor_ahead():
    profile = load_profile("thesis-sim")
    camera = profile.camera
    ahead_m = camera.z_m / math.tan(camera.pitch_rad)
    along_m = camera.z_m / math.sin(camera.pitch_rad)
    met = tree_of(profile, odometry(0.0)).transform("base_link", "camera_optical_frame", (0.0, 0.0, along_m))
    assert met == pytest.approx((camera.x_m + ahead_m, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("name", known_profiles())
def test_the_urdf_has_the_frames_of_tf_where_tf_has_them(name):
    profile = load_profile(name)
    robot = ET.fromstring(urdf_of(profile))
    links = [link.get("name") for link in robot.findall("link")]
    static = static_transforms(profile, 0.0).transforms
    assert len(links) == len(set(links))
    assert set(links) == {"base_link", *(each.child for each in static)}
    for joint, transform in zip(robot.findall("joint"), static, strict=True):
        assert joint.get("type") == "fixed"
        assert joint.find("parent").get("link") == transform.parent
        assert joint.find("child").get("link") == transform.child
        numbers = [float(word) for word in joint.find("origin").get("xyz").split()]
        assert numbers == pytest.approx(transform.translation, abs=1e-6)


@pytest.mark.parametrize("name", known_profiles())
def test_the_urdf_parser_of_ros_takes_the_model(name, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_of(load_profile(name)))
    check = [Path(sys.executable).parent / "check_urdf", path]
    done = subprocess.run(check, check=False, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Successfully Parsed XML" in done.stdout
    assert "root Link: base_link" in done.stdout
    for frame in ("base_footprint", "laser", "camera_link", "camera_optical_frame"):
        assert re.search(rf"child\(\d\):  {frame}\n", done.stdout)


def test_the_pinhole_projects_the_edge_of_view_to_the_edge_of_the_picture():
    camera = ROSBOT.camera
    info = pinhole(camera, 640, 480)
    k, p = np.array(info.k).reshape(3, 3), np.array(info.p).reshape(3, 4)
    left = np.array([-math.tan(camera.hfov_rad / 2), -math.tan(camera.vfov_rad / 2), 1.0])
    assert (k @ left)[:2] == pytest.approx((-0.5, -0.5))  # the first pixel's own edge, as pixels are centred on numbers
    assert p @ [*left, 1.0] == pytest.approx(k @ left)
    half = info_for(info, (320, 240), 2.0)
    assert np.array(half.k).reshape(3, 3) @ left == pytest.approx([-0.5, -0.5, 1.0])
    assert (half.stamp_s, half.width, half.height) == (2.0, 320, 240)


def test_a_calibration_file_of_ros_is_read_for_pictures_of_the_profiles_size(tmp_path):
    path = tmp_path / "astra.yaml"
    path.write_text(CALIBRATION)
    info = load_calibration(path, ROSBOT.camera)
    assert (info.width, info.height, info.distortion_model) == (640, 480, "plumb_bob")
    assert info.d == (0.1, -0.2, 0.001, 0.002, 0.0)
    assert info.k == pytest.approx((550.0, 0.0, 320.0, 0.0, 555.0, 240.0, 0.0, 0.0, 1.0))
    assert info.p[:4] == pytest.approx((545.0, 0.0, 320.0, 0.0))
    assert decode(type(info), encode(info)) == info


def test_a_calibration_that_the_settings_name_is_on_the_bus_with_each_picture_for_ros2(tmp_path):
    (tmp_path / "astra.yaml").write_text(CALIBRATION)
    settings = tmp_path / "my-robot.toml"
    settings.write_text('[camera]\ncalibration = "astra.yaml"\n')
    info = load_camera_info(settings, ROSBOT.camera)
    assert load_camera_info(None, ROSBOT.camera) is None
    inner = NullRobot(ROSBOT, time.monotonic, time.sleep)
    with served(inner, floor=True, calibration=info) as robot, joined(robot) as bus:
        reader = bus.reader(CAMERA_INFO)
        wait_for(lambda: reader.newest() is not None)
        assert reader.newest().message.k == pytest.approx(info.k)


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        ("image_width: 1280", "image_width: 1000"),
        ("plumb_bob", "fisheye62"),
        ("1100.0,", ".nan,"),
        ("data: [0.1, -0.2", "data: [-0.2"),
        ("camera_matrix", "matrix"),
        ("image_height: 960", "image_height: [9"),
        (CALIBRATION, "- 1"),
        ("1110.0", "0.0"),
    ],
)
def test_what_is_no_calibration_is_refused_by_name(tmp_path, was, becomes):
    path = tmp_path / "bad.yaml"
    path.write_text(CALIBRATION.replace(was, becomes))
    with pytest.raises(ConfigError, match=r"bad\.yaml"):
        load_calibration(path, ROSBOT.camera)


def test_a_missing_calibration_is_told(tmp_path):
    with pytest.raises(ConfigError, match="cannot read"):
        load_calibration(tmp_path / "none.yaml", ROSBOT.camera)


def test_the_odometrys_covariance_grows_with_the_way_and_never_claims_to_be_zero():
    drift = Drift(ROSBOT.base)
    first = drift.note(odometry(0.0)).spread
    for turn in range(1, 41):
        spread = drift.note(odometry(turn * 0.05, 0.05 * turn, 0.0, 0.05 * turn)).spread
    assert first.position_m > 0.0
    assert first.yaw_rad > 0.0
    assert 0.04 < spread.position_m < 0.5  # after 2 m
    assert 0.1 < spread.yaw_rad < 0.4  # after 2 rad; this base slips
    again = drift.note(odometry(3.0)).spread  # put down elsewhere
    assert again == first
    ros = CODECS[Odometry].to_ros(drift.note(odometry(4.0)))
    for covariance in (ros.pose.covariance, ros.twist.covariance):
        diagonal = np.diag(covariance.reshape(6, 6))
        assert (diagonal > 0.0).all()
        assert diagonal[2] >= 1e3  # nobody measures the height
    assert isinstance(drift.note(odometry(5.0)).spread, Spread)


def test_the_imu_claims_no_roll_and_pitch_and_has_gravity():
    ros = CODECS[Imu].to_ros(Imu(1.0, 0.5, 0.1, 0.2, 0.3))
    orientation = ros.orientation_covariance.reshape(3, 3)
    assert min(orientation[0, 0], orientation[1, 1]) >= 1e3
    assert 0.0 < orientation[2, 2] < 1.0
    assert ros.linear_acceleration.z == pytest.approx(9.81, abs=0.01)
    assert (np.diag(ros.linear_acceleration_covariance.reshape(3, 3)) > 0.0).all()


@pytest.mark.parametrize(
    ("picture", "name"),
    [
        (compress(Image(1.0, np.zeros((4, 6, 3), np.uint8)), "jpeg"), "rgb8; jpeg compressed bgr8"),
        (compress(Image(1.0, np.zeros((4, 6), np.uint8), "mono8"), "jpeg"), "mono8; jpeg compressed"),
        (compress(Image(1.0, np.zeros((4, 6, 3), np.uint8)), "png"), "rgb8; png compressed bgr8"),
        (compress(Image(1.0, np.zeros((4, 6), np.uint8), "mono8"), "png"), "mono8; png compressed"),
        (compress_depth(DepthImage(1.0, np.zeros((4, 6), np.uint16))), "16UC1; png compressed"),
    ],
)
def test_a_ros2_picture_is_named_as_image_transport_names_it(picture, name):
    ros = CODECS[type(picture)].to_ros(picture)
    assert (ros.format, ros.header.frame_id) == (name, "camera_optical_frame")
    assert size_of(picture.data) == (6, 4)
    assert decode(type(picture), encode(picture)) == picture


def test_on_the_bus_ros2_gets_all_of_it_and_stamps_that_count_from_1970():
    with served(real_time_null(), floor=True) as robot, joined(robot) as bus:
        topics = (TF, ODOM, SCAN, CAMERA, CAMERA_INFO, TF_STATIC, DESCRIPTION)  # this comes long after the robot began
        readers = {topic.key: bus.reader(topic) for topic in topics}
        came = {}
        wait_for(lambda: all(came.update({key: reader.newest()}) or came[key] for key, reader in readers.items()))
        for key, received in came.items():
            assert abs(time.time() - received.attachment.time_s) < 5.0, key
            assert abs(time.time() - getattr(received.message, "stamp_s", time.time())) < 5.0, key
        buffer = TfBuffer()
        buffer.add(as_ros(came["tf_static"].message), static=True)
        buffer.add(as_ros(came["tf"].message))
        assert buffer.roots() == {"odom"}
        assert "<robot name=" in came["robot_description"].message.data
        picture, info = came["camera/color/image_raw/compressed"].message, came["camera/color/camera_info"].message
        assert size_of(picture.data) == (info.width, info.height)


def test_tf_of_a_drive_runs_forward_in_time():
    with served(real_time_null(), floor=True) as robot, joined(robot) as bus:
        reader, buffer, came = bus.reader(TF, 32), TfBuffer(), []
        wait_for(lambda: came.extend(reader.poll()) or len(came) > 10)
        for received in came:
            buffer.add(as_ros(received.message))


def test_a_clock_that_counts_from_1970_is_left_alone_and_another_is_measured_once():
    assert unix_offset_s(lambda: 1.7e9) == 0.0
    assert unix_offset_s(lambda: 100.0, lambda: 1.7e9) == 1.7e9 - 100.0


@pytest.mark.parametrize("lockstep", [True, False])
def test_in_lockstep_what_belongs_to_an_observation_is_not_dropped_and_what_is_latched_stays_so(lockstep):
    asked = {}
    bus = SimpleNamespace(boundary=None, publisher=lambda topic, qos: asked.setdefault(topic.key, qos))
    GraphPublisher(bus, load_profile("thesis-sim"), lockstep=lockstep)
    waits = IN_LOCKSTEP if lockstep else None
    assert asked.pop("tf_static") is asked.pop("robot_description") is None
    assert asked == {"tf": waits, "camera/color/camera_info": waits, "camera/depth/camera_info": waits}
