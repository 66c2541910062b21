import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lira.hal.profile import load_profile
from lira.hal.safety.protective_field import measure_clearance
from lira.robot.rplidar.capsules import DENSE, CapsuleDecoder
from lira.robot.rplidar.stream import Counts, Stream
from lira.robot.rplidar.turn import Mounting, Turn, TurnCutter, scan_of
from lira.sim_backend.emulators.rplidar_streams import encode_dense

PROFILE = load_profile("rosbot2")
LIDAR = PROFILE.lidar
POINTS = 400


def spin(turns, start_rad=1.0, points=POINTS, jitter_rad=0.0):
    """A head that turns at 10 Hz: angles, distances, times."""
    count = round(turns * points)
    theta = start_rad + np.arange(count) * math.tau / points
    theta += np.random.default_rng(0).uniform(-jitter_rad, jitter_rad, count)
    return theta % math.tau, np.full(count, 2.0), 100.0 + np.arange(count) * 0.1 / points


def cut(theta, distance, time, cuts=(), mounting=Mounting()):  # noqa: B008 - frozen
    cutter = TurnCutter(mounting)
    edges = [0, *sorted(min(c, len(theta)) for c in cuts), len(theta)]
    turns = []
    for a, b in pairwise(edges):
        turns += cutter.add(theta[a:b], distance[a:b], time[a:b])
    return turns


@settings(max_examples=50, deadline=None)
@given(
    cuts=st.lists(st.integers(0, 1800), max_size=20),
    offset=st.floats(-math.pi, math.pi),
    mirror=st.booleans(),
    start=st.floats(0, 6.28),
)
def test_turns_are_whole_and_cut_behind_the_robot_however_the_points_come(cuts, offset, mirror, start):
    turns = cut(*spin(4.5, start, jitter_rad=0.004), cuts, Mounting(offset, mirror))
    assert len(turns) in (3, 4)
    for turn in turns:
        assert abs(len(turn.bearing_rad) - POINTS) <= 2
        assert np.all(np.diff(turn.time_s) > 0)
        sweep = -turn.bearing_rad if not mirror else turn.bearing_rad
        assert np.median(np.diff(sweep)) == pytest.approx(math.tau / POINTS, rel=0.2)
        assert np.count_nonzero(np.abs(np.diff(turn.bearing_rad)) > 3.0) <= 2  # only jitter at the seam


def test_a_gap_of_more_than_half_a_turn_drops_the_turn():
    theta, distance, time = spin(4.0)
    time = time.copy()
    time[600:] += 0.4
    cutter = TurnCutter(Mounting())
    turns = cutter.add(theta[:600], distance[:600], time[:600]) + cutter.add(theta[600:], distance[600:], time[600:])
    assert len(turns) <= 3
    assert all(turn.time_s[-1] - turn.time_s[0] < 0.11 for turn in turns)


def test_each_beam_has_its_time():
    turn = cut(*spin(3.0))[0]
    scan = scan_of(turn, LIDAR)
    assert scan.time_increment == pytest.approx(-0.1 / POINTS, rel=0.02)
    assert scan.stamp_s == pytest.approx(turn.time_s[-1], abs=0.001)  # of beam 0, which comes last
    ahead = np.argmin(np.abs(turn.bearing_rad))
    beam = round(math.pi / scan.angle_increment)
    assert scan.stamp_s + beam * scan.time_increment == pytest.approx(turn.time_s[ahead], abs=0.001)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("ascending_time", [False, True])
def test_no_beam_is_from_the_future_when_points_came_late(mirror, ascending_time):
    turn = cut(*spin(3.0), mounting=Mounting(0.0, mirror))[0]
    share = np.linspace(0.0, 1.0, len(turn.time_s))
    late = Turn(turn.bearing_rad, turn.distance_m, turn.time_s[0] + 0.1 * np.sqrt(share))
    scan = scan_of(late, LIDAR, ascending_time=ascending_time)
    last_s = scan.stamp_s + (len(scan.ranges) - 1) * scan.time_increment
    assert max(scan.stamp_s, last_s) <= late.time_s[-1] + 1e-9
    assert min(scan.stamp_s, last_s) > late.time_s[0] - 0.01


def test_a_point_on_the_seam_does_not_confuse_the_times():
    turn = cut(*spin(3.0, start_rad=math.pi))[0]
    assert turn.bearing_rad[0] == -math.pi
    assert scan_of(turn, LIDAR).time_increment == pytest.approx(-0.1 / LIDAR.beams, rel=0.02)


def test_ranges_are_named_after_rep_117_and_the_nearest_counts():
    bearing = np.concatenate([np.linspace(math.pi, -math.pi, POINTS, endpoint=False), [0.5, 0.5, -0.5, 1.0, 1.5, 2.0]])
    distance = np.concatenate([np.full(POINTS, 3.0), [1.0, 2.0, 0.0, 0.05, 0.5, 0.0]])
    distance[np.abs(bearing + 1.0) < 0.2] = 0.0
    distance[np.abs(bearing - 2.5) < 0.2] = 14.0
    turn = Turn(bearing, distance, np.linspace(0.0, 0.1, len(bearing)))
    scan = scan_of(turn, LIDAR)

    def at(angle):
        return scan.ranges[round((angle + math.pi) / scan.angle_increment)]

    assert at(0.5) == 1.0
    assert at(-0.5) == 3.0  # an invalid point does not hide a valid one
    assert at(1.0) == -math.inf
    assert math.isnan(at(-1.0))
    assert at(2.5) == math.inf
    assert scan.ranges.dtype == np.float32


def test_too_little_of_a_turn_is_no_scan():
    turn = cut(*spin(3.0))[0]
    half = slice(0, 180)
    assert scan_of(Turn(turn.bearing_rad[half], turn.distance_m[half], turn.time_s[half]), LIDAR) is None


def evenly(points, zeros=0.0, seed=0):
    """A turn in a hall with walls at 2 m, in which a share of the samples measures nothing."""
    rng = np.random.default_rng(seed)
    bearing = np.linspace(math.pi, -math.pi, points, endpoint=False) + rng.uniform(-1e-3, 1e-3)
    distance = np.where(rng.random(points) < zeros, 0.0, 2.0)
    return Turn((bearing + math.pi) % math.tau - math.pi, distance, np.linspace(0.0, 0.1, points))


@pytest.mark.parametrize("points", [98, 133, 200, 266, 333, 364, 400, 800])
@pytest.mark.parametrize("zeros", [0.0, 0.1, 0.2])
def test_the_field_drives_in_every_mode_and_at_every_speed_of_the_head(points, zeros):
    for seed in range(20):
        clearance = measure_clearance(PROFILE, PROFILE.field, scan_of(evenly(points, zeros, seed), LIDAR))
        assert clearance.ahead_m > 1.5
        assert clearance.behind_m > 1.5


def test_a_beam_that_no_point_fell_into_has_the_nearer_of_its_neighbours():
    turn = evenly(200)
    ahead = np.abs(turn.bearing_rad) < math.radians(10.0)
    scan = scan_of(Turn(turn.bearing_rad, np.where(ahead, 1.0, 2.0), turn.time_s), LIDAR)
    near = np.count_nonzero(scan.ranges == 1.0)
    assert np.count_nonzero(np.isfinite(scan.ranges)) == LIDAR.beams
    assert near >= np.count_nonzero(ahead) * 2


def test_what_measured_nothing_over_a_width_stays_unknown():
    turn = evenly(800)
    blind = np.abs(turn.bearing_rad) < math.radians(30.0)
    scan = scan_of(Turn(turn.bearing_rad, np.where(blind, 0.0, 2.0), turn.time_s), LIDAR)
    assert np.count_nonzero(np.isnan(scan.ranges)) > 60
    assert measure_clearance(PROFILE, PROFILE.field, scan).ahead_m == 0.0
    nothing = scan_of(Turn(turn.bearing_rad, np.zeros(800), turn.time_s), LIDAR)
    assert np.isnan(nothing.ranges).all()


def test_points_that_were_lost_are_no_neighbours():
    turn = evenly(800)
    here = np.abs(turn.bearing_rad) > math.radians(20.0)
    scan = scan_of(Turn(turn.bearing_rad[here], turn.distance_m[here], turn.time_s[here]), LIDAR)
    assert np.count_nonzero(np.isnan(scan.ranges)) > 35


def test_angles_that_step_back_over_the_seam_belong_to_the_turn_that_ends_there():
    theta, distance, time = spin(4.5, points=800)
    ahead = np.arange(len(theta)) % 3 == 0  # every third is not corrected
    theta = np.where(ahead, theta + math.radians(7.0), theta) % math.tau
    cutter = TurnCutter(Mounting(), math.radians(8.0))
    turns = []
    for at in range(0, len(theta), 7):
        turns += cutter.add(theta[at : at + 7], distance[at : at + 7], time[at : at + 7])
    assert len(turns) == 4
    for turn in turns:
        assert abs(len(turn.time_s) - 800) <= 2
        corrected = turn.time_s[np.argsort(turn.bearing_rad)]
        assert corrected[:10].min() > corrected[-10:].max()  # the rear, one side of the seam, was seen last


def test_scans_in_the_order_of_time_are_the_same_scans():
    turn = cut(*spin(3.0))[0]
    scan, ascending = scan_of(turn, LIDAR), scan_of(turn, LIDAR, ascending_time=True)
    assert ascending.time_increment == -scan.time_increment > 0.0
    assert ascending.angle_increment == -scan.angle_increment
    beams = np.arange(LIDAR.beams)
    angles, times = scan.angle_min + beams * scan.angle_increment, scan.stamp_s + beams * scan.time_increment
    assert (ascending.angle_min + beams * ascending.angle_increment)[::-1] == pytest.approx(angles)
    assert (ascending.stamp_s + beams * ascending.time_increment)[::-1] == pytest.approx(times)
    np.testing.assert_array_equal(ascending.ranges[::-1], scan.ranges)
    assert measure_clearance(PROFILE, PROFILE.field, ascending).ahead_m > 1.5


def test_a_burst_of_bytes_keeps_each_points_time():
    theta, distance, _ = spin(3.0, points=1600)
    capsules = encode_dense(theta[::40], distance.reshape(-1, 40), first=True)
    stream = Stream(CapsuleDecoder(DENSE, 62.5e-6), 62.5e-6, 0.0, TurnCutter(Mounting()), LIDAR, Counts())
    scans = stream.feed(capsules[:5000], 100.0) + stream.feed(capsules[5000:], 100.155)
    assert len(scans) == 2
    for scan in scans:
        assert scan.scan_time == pytest.approx(0.1, rel=0.1)
    assert scans[1].stamp_s <= 100.155
