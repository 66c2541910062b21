"""Depth, IMU, rangers and battery of the twin."""

import math

import msgspec
import numpy as np
import pytest

from lira.hal.messages import STOP, Command, Twist
from lira.hal.profile import Battery, Depth, Imu, load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.sim_backend import drive
from lira.sim_backend.layout import build
from lira.sim_backend.onboard import Accelerometer, read_battery
from lira.sim_backend.sensors import Sensors
from lira.sim_backend.twin import Twin
from lira.sim_backend.world import Box, Limits, World

DEPTH = Depth(width_px=64, height_px=48, range_min_m=0.1, range_max_m=6.0)
ROSBOT = msgspec.structs.replace(load_profile("rosbot2"), depth=DEPTH)


@pytest.fixture(params=["sketch", "tiny"])
def sensors(request):
    opened = []

    def open_with(*boxes, profile=ROSBOT):
        opened.append(
            Sensors(
                profile,
                build(World(description="", limits=Limits(finish_m=9.0, lost_m=9.0), box=boxes), 0),
                request.param,
                0,
            )
        )
        return opened[-1]

    yield open_with
    for one in opened:
        one.close()


def at(x=0.0, y=0.0, yaw=0.0, linear=0.0, angular=0.0):
    return drive.motion(x, y, yaw, linear, angular)


def near(sensors):
    """What the rangers read."""
    return {name: value.range_m for name, value in sensors.newest(at(), 0.0).items() if name.startswith("range")}


def test_depth_is_the_distance_along_the_axis_in_millimetres(sensors):
    wall = Box(x_m=2.5, y_m=0.0, length_m=1.0, width_m=8.0, height_m=4.0)
    depth = sensors(wall).read("depth", at(), 0.0)
    assert depth.data.shape == (48, 64)
    assert depth.data.dtype == np.uint16
    eye_m = 2.0 - ROSBOT.camera.x_m
    middle = depth.data[20:24]
    assert middle == pytest.approx(1000 * eye_m, abs=5)  # flat, also at the edges: no arc of distances


def test_depth_sees_the_floor_and_nothing_in_the_sky(sensors):
    data = sensors().read("depth", at(), 0.0).data
    assert (data[:24] == 0).all()
    rows = np.nonzero(data[:, 32])[0]
    camera = ROSBOT.camera
    up = (1.0 - (2.0 * rows + 1.0) / 48) * math.tan(camera.vfov_rad / 2)
    assert data[rows, 32] == pytest.approx(1000 * camera.z_m / -up, rel=0.05)


def test_depth_beyond_its_ranges_is_zero(sensors):
    profile = msgspec.structs.replace(ROSBOT, depth=msgspec.structs.replace(DEPTH, range_max_m=1.0))
    wall = Box(x_m=2.5, y_m=0.0, length_m=1.0, width_m=8.0, height_m=4.0)
    assert sensors(wall, profile=profile).read("depth", at(), 0.0).data[10:24].max() == 0


def test_rangers_tell_what_is_beside_their_corner(sensors):
    block = Box(x_m=0.5, y_m=0.2, length_m=0.2, width_m=0.2, height_m=0.5)
    seen = near(sensors(block))
    assert seen["range_fl"] == pytest.approx(0.31, abs=0.03)
    assert seen["range_rl"] == seen["range_rr"] == math.inf


def test_a_ranger_that_touches_something_says_too_close(sensors):
    block = Box(x_m=0.2, y_m=0.05, length_m=0.18, width_m=0.2, height_m=0.5)
    seen = near(sensors(block))
    assert seen["range_fl"] == -math.inf


def test_the_imu_measures_turn_and_accelerations():
    imu = Accelerometer(Imu(), np.random.default_rng(0))
    assert imu.read(at(yaw=4.0), 0.0).yaw_rad == pytest.approx(4.0 - math.tau)
    reading = imu.read(at(linear=0.2, angular=0.5), 0.1)
    assert reading.linear_m_s2 == pytest.approx(2.0)
    assert reading.lateral_m_s2 == pytest.approx(0.1)
    assert reading.angular_rad_s == 0.5


def test_the_battery_empties_and_stays_empty():
    battery = Battery(full_v=12.6, empty_v=10.8, lasts_s=100.0)
    volts = [read_battery(battery, now_s).voltage_v for now_s in (0.0, 50.0, 100.0, 1000.0)]
    assert volts == pytest.approx([12.6, 11.7, 10.8, 10.8])


def test_each_sensor_of_the_twin_comes_at_its_own_rate():
    robot = GovernedRobot(Twin(ROSBOT, "room", renderer="tiny"))
    robot.open()
    try:
        stamps = {name: set() for name in ("imu", "battery", "depth", "ranges")}
        robot.drive(Command(STOP, robot.now()))
        for _ in range(40):
            robot.drive(Command(Twist(0.1, 0.3), robot.now()))
            robot.wait(robot.now() + 0.05)
            seen = robot.read()
            for name, found in stamps.items():
                value = getattr(seen, name)
                found.add((value[0] if name == "ranges" else value).stamp_s)
        assert {name: len(found) for name, found in stamps.items()} == {
            "imu": 20,
            "battery": 2,
            "depth": 10,
            "ranges": 20,
        }
        assert len(seen.ranges) == 4
    finally:
        robot.close()
