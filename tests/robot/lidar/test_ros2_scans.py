"""Scans as slam_toolbox and Cartographer take them, of the twin and of the lidar: angles, increments, time.

Both are written down here by their sources: what they count, what they check, and what they throw away.
"""

import math

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from test_rplidar_turn import LIDAR, cut, spin

from lira.hal.messages.ros.codec import encode, ros_type_of
from lira.hal.messages.ros.types import definition
from lira.hal.profile import known_profiles, load_profile
from lira.robot.rplidar.turn import scan_of
from lira.sim_backend.twin import Twin

PIECES = 10  # num_subdivisions_per_laser_scan of Cartographer's backpack_2d.lua


def as_ros(scan):
    """The message as a decoder of others reads it."""
    ros_type = ros_type_of(type(scan))
    schema = Schema(data=definition(ros_type).encode(), encoding="ros2msg", id=1, name=ros_type)
    return DecoderFactory().decoder_for("cdr", schema)(encode(scan))


def lidar_scans(*, ascending_time=False, turns=4):
    found = [scan_of(turn, LIDAR, ascending_time=ascending_time) for turn in cut(*spin(turns))]
    return [as_ros(scan) for scan in found if scan is not None]


def twin_scans(name, count=3):
    twin = Twin(load_profile(name), "room", renderer="sketch")
    twin.open()
    found = []
    while len(found) < count:
        twin.wait(twin.now() + 0.1)
        scan = twin.read().scan
        if not found or scan is not found[-1]:
            found.append(scan)
    twin.close()
    return [as_ros(scan) for scan in found]


def slam_toolbox_count(scan):
    """How many readings a scan has to have; one with another count is dropped. Ours of a whole turn ends a beam before
    it begins, so it is none of those that have the first beam twice.
    """
    wide = abs(scan.angle_max - scan.angle_min)
    whole_turn = abs(wide - 2 * math.pi) < abs(scan.angle_increment) - 2 * math.pi * np.finfo(np.float32).eps
    if wide > 6.10865 and wide / abs(scan.angle_increment) + 1 == len(scan.ranges):
        whole_turn = False
    return math.floor(wide / abs(scan.angle_increment) + 0.5) + (0 if whole_turn else 1)


def cartographer_points(scan):
    """cartographer_ros's ToPointCloudWithIntensities: angles and times of its points, counted from the last one."""
    assert scan.range_min >= 0.0
    assert scan.range_max >= scan.range_min
    assert scan.angle_increment != 0.0
    assert (scan.angle_max > scan.angle_min) == (scan.angle_increment > 0.0)
    number = np.arange(len(scan.ranges))
    times = number * scan.time_increment
    return scan.angle_min + number * scan.angle_increment, times - times[-1]


def kept_pieces(scans):
    """How many of a scan's pieces Cartographer keeps: each has to end later than the one before."""
    kept, last_s = 0, -math.inf
    for scan in scans:
        began_s = scan.header.stamp.sec + scan.header.stamp.nanosec * 1e-9
        _, times = cartographer_points(scan)
        end_s = began_s + (len(scan.ranges) - 1) * scan.time_increment
        for piece in range(PIECES):
            last = len(times) * (piece + 1) // PIECES - 1
            piece_s = end_s + times[last]
            if piece_s > last_s:
                kept, last_s = kept + 1, piece_s
    return kept


def all_scans():
    return {
        **{f"twin {name}": lambda name=name: twin_scans(name) for name in known_profiles()},
        "lidar": lidar_scans,
        "lidar, ascending": lambda: lidar_scans(ascending_time=True),
    }


@pytest.mark.parametrize("name", all_scans())
def test_slam_toolbox_counts_as_many_readings_as_a_ros2_scan_has(name):
    scans = all_scans()[name]()
    assert scans
    for scan in scans:
        assert slam_toolbox_count(scan) == len(scan.ranges)
        assert scan.header.frame_id == "laser"
        assert scan.scan_time >= 0.0
        told = [each for each in scan.ranges if math.isfinite(each)]
        assert told
        assert all(scan.range_min <= each <= scan.range_max for each in told)


@pytest.mark.parametrize("name", [name for name in all_scans() if name != "lidar"])
def test_cartographer_takes_every_ros2_scan_and_its_points_ascend_in_time(name):
    scans = all_scans()[name]()
    for scan in scans:
        _, times = cartographer_points(scan)
        assert (np.diff(times) >= 0.0).all()
    if scans[0].time_increment:
        assert kept_pieces(scans) == PIECES * len(scans)


def test_cartographer_keeps_little_of_a_ros2_scan_in_the_order_of_angles_so_there_is_a_setting():
    """The head turns clockwise: in the order of angles time runs back, which Cartographer does not take."""
    plain, ascending = lidar_scans(), lidar_scans(ascending_time=True)
    assert kept_pieces(plain) <= len(plain) + 1
    assert kept_pieces(ascending) == PIECES * len(ascending)


def test_in_either_order_a_ros2_scan_says_the_same():
    for plain, ascending in zip(lidar_scans(), lidar_scans(ascending_time=True), strict=True):
        angles, times = cartographer_points(plain)
        turned, later = cartographer_points(ascending)
        assert np.allclose(turned[::-1], angles, atol=1e-5)
        assert np.array_equal(np.array(ascending.ranges)[::-1], np.array(plain.ranges), equal_nan=True)
        at = plain.header.stamp.sec + plain.header.stamp.nanosec * 1e-9 + np.arange(len(times)) * plain.time_increment
        began_s = ascending.header.stamp.sec + ascending.header.stamp.nanosec * 1e-9
        assert np.allclose((began_s + np.arange(len(later)) * ascending.time_increment)[::-1], at, atol=1e-4)
