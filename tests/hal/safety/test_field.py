"""The protective field: what the lidar sees ahead slows and stops, the way back stays free."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from lira.hal.messages import STOP, Command, LaserScan, Reason, Twist
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.safety.protective_field import Clearance, limit_speed, measure_clearance
from lira.hal.testing import NullRobot

ROSBOT = load_profile("rosbot2")
FIELD, LIDAR, BASE = ROSBOT.field, ROSBOT.lidar, ROSBOT.base
INCREMENT = math.tau / LIDAR.beams
GO = Twist(0.2, 0.0)


def scan(*points, stamp_s=0.0, base=math.inf):
    """A full turn in open space with single points at (x, y) of base_link."""
    ranges = np.full(LIDAR.beams, base, np.float32)
    for x_m, y_m in points:
        angle = math.atan2(y_m, x_m - LIDAR.x_m)
        ranges[round((angle + math.pi) / INCREMENT) % LIDAR.beams] = math.hypot(x_m - LIDAR.x_m, y_m)
    return LaserScan(stamp_s, -math.pi, INCREMENT, LIDAR.range_min_m, LIDAR.range_max_m, ranges)


def clearance(shown):
    return measure_clearance(ROSBOT, FIELD, shown)


@pytest.mark.parametrize(("point", "ahead_m", "behind_m"), [
    ((0.5, 0.0), 0.4, math.inf),
    ((0.5, 0.10), 0.4, math.inf),
    ((0.5, 0.20), math.inf, math.inf),
    ((-0.6, -0.05), math.inf, 0.5),
])  # fmt: skip
def test_only_what_is_in_the_way_counts(point, ahead_m, behind_m):
    got = clearance(scan(point))
    assert got.ahead_m == pytest.approx(ahead_m, abs=0.01)
    assert got.behind_m == pytest.approx(behind_m, abs=0.01)


def test_too_close_is_in_the_way():
    shown = scan()
    shown.ranges[LIDAR.beams // 2] = -math.inf
    assert clearance(shown).ahead_m < FIELD.stop_m
    assert clearance(shown).behind_m == math.inf


def test_a_lidar_that_says_nothing_blocks_and_some_lost_beams_do_not():
    assert clearance(scan(base=math.nan)).ahead_m == 0.0
    assert clearance(scan(base=math.nan)).behind_m == 0.0
    half = scan()
    assert clearance(replace(half, ranges=half.ranges[: LIDAR.beams // 2])).ahead_m == 0.0
    some = scan()
    some.ranges[::10] = math.nan
    assert clearance(some).ahead_m == math.inf


def test_where_a_sector_lidar_does_not_look_the_way_is_free():
    sim = load_profile("thesis-sim")
    lidar = sim.lidar
    increment = lidar.fov_rad / (lidar.beams - 1)
    seen = LaserScan(0.0, -lidar.fov_rad / 2, increment, 0.05, 4.0, np.full(lidar.beams, 0.3, np.float32))
    got = measure_clearance(sim, FIELD, seen)
    assert got.ahead_m < 0.25
    assert got.behind_m == math.inf


@pytest.mark.parametrize(("x_m", "wanted", "allowed", "cut"), [
    (1.0, 0.2, 0.2, ""),
    (0.3, 0.2, 0.1, "field_slow"),
    (0.3, 0.05, 0.05, ""),
    (0.3, -0.2, -0.2, ""),
    (0.15, 0.2, 0.0, "field_stop"),
    (0.15, -0.2, -0.2, ""),
    (-0.15, -0.2, 0.0, "field_stop"),
    (-0.15, 0.2, 0.2, ""),
])  # fmt: skip
def test_zones(x_m, wanted, allowed, cut):
    assert limit_speed(FIELD, clearance(scan((x_m, 0.0))), wanted, 0.1) == (allowed, cut)


@pytest.mark.parametrize(("free_m", "wanted", "allowed", "cut"), [
    (FIELD.stop_m, 0.2, FIELD.slow_m_s, "field_slow"),
    (FIELD.stop_m, FIELD.slow_m_s, FIELD.slow_m_s, ""),
    (math.nextafter(FIELD.stop_m, 0.0), 0.01, 0.0, "field_stop"),
    (FIELD.slow_m, 0.2, 0.2, ""),
    (math.nextafter(FIELD.slow_m, 0.0), 0.2, FIELD.slow_m_s, "field_slow"),
])  # fmt: skip
@pytest.mark.parametrize("sign", [1, -1])
def test_the_edges_of_the_zones_either_way(free_m, wanted, allowed, cut, sign):
    other_m = math.inf if cut else 0.0  # the other way has no say
    ways = (free_m, other_m) if sign > 0 else (other_m, free_m)
    got, name = limit_speed(FIELD, Clearance(0.0, *ways), sign * wanted, 0.0)
    assert (got, name) == (sign * allowed, cut)


def test_the_edges_of_the_way():
    base = msgspec.structs.replace(BASE, width_m=0.25)
    field = msgspec.structs.replace(FIELD, margin_m=0.125)
    profile = msgspec.structs.replace(ROSBOT, base=base, lidar=msgspec.structs.replace(LIDAR, x_m=0.0, beams=1))

    def look(ahead, left, behind, range_min=0.0):
        beams = np.array([ahead, left, behind, 9.0], np.float32)
        got = measure_clearance(profile, field, LaserScan(0.0, 0.0, math.pi / 2, range_min, 10.0, beams))
        return round(got.ahead_m, 3), round(got.behind_m, 3)

    assert look(9.0, 9.0, 9.0) == (8.9, 8.9)
    assert look(9.0, 0.25, 9.0) == (0.0, 8.9)  # beside the axle, at the very edge of the way
    assert look(9.0, 0.26, 9.0) == (8.9, 8.9)
    # Too close blocks where the beam looks, also where that point lies on the other side of the axle.
    assert look(-math.inf, 9.0, 9.0) == (0.0, 8.9)
    assert look(9.0, 9.0, -math.inf) == (8.9, 0.0)
    profile = msgspec.structs.replace(profile, lidar=msgspec.structs.replace(LIDAR, x_m=0.05, beams=1))
    assert look(9.0, 9.0, -math.inf, 0.02)[1] == 0.0


def dark(low_deg, high_deg, *, behind=False, share=1.0):
    """Open space, but nothing known at these angles to either side of straight ahead, or of straight back."""
    shown = scan()
    off = np.degrees(np.abs(shown.angle_min + INCREMENT * np.arange(LIDAR.beams)))
    off = 180.0 - off if behind else off
    nothing = np.flatnonzero((off > low_deg) & (off < high_deg))
    shown.ranges[nothing[: round(share * len(nothing))]] = math.nan
    return shown


@pytest.mark.parametrize("behind", [False, True])
def test_it_has_to_see_30_degrees_to_each_side_of_where_it_goes(behind):
    def free_m(shown):
        got = clearance(shown)
        return got.behind_m if behind else got.ahead_m

    assert free_m(dark(16.0, 30.0, behind=behind)) == 0.0
    assert free_m(dark(31.0, 70.0, behind=behind)) == math.inf
    assert free_m(dark(-1.0, 30.0, behind=behind, share=0.2)) == math.inf
    assert free_m(dark(-1.0, 30.0, behind=behind, share=0.3)) == 0.0


@pytest.mark.parametrize("nothing", [0.0, -0.0, -5.0, -1e-3, math.nan])
def test_what_drivers_write_for_nothing_is_blind_not_free(nothing):
    got = clearance(scan(base=nothing))
    assert (got.ahead_m, got.behind_m) == (0.0, 0.0)


def test_a_scan_that_is_shut_in_stands():
    for shown in (scan(base=-math.inf), scan(base=0.05)):
        got = clearance(shown)
        assert max(got.ahead_m, got.behind_m) < FIELD.stop_m


def test_without_a_fresh_scan_it_does_not_drive():
    free = clearance(scan())
    assert limit_speed(FIELD, free, 0.2, FIELD.max_age_s) == (0.2, "")
    assert limit_speed(FIELD, free, 0.2, FIELD.max_age_s + 0.1) == (0.0, "field_blind")
    assert limit_speed(FIELD, None, 0.2, 0.0) == (0.0, "field_blind")
    assert limit_speed(FIELD, None, 0.0, 0.0) == (0.0, "")


@pytest.mark.parametrize(("ahead_s", "drives"), [(0.0, True), (0.09, True), (0.11, False), (0.4, False)])
def test_a_scan_from_the_future_is_not_fresh_for_longer(ahead_s, drives):
    class Ahead(NullRobot):
        def read(self):
            self.shown = getattr(self, "shown", None) or scan(stamp_s=ahead_s)
            return replace(super().read(), scan=self.shown)

    robot = GovernedRobot(Ahead(ROSBOT))
    reasons = []
    while robot.now() < 1.5:
        robot.read()
        applied = robot.drive(Command(GO if reasons else STOP, robot.now()))
        reasons.append((round(robot.now(), 2), applied.twist.linear_m_s > 0.0))
        robot.wait(robot.now() + 0.02)
    moved = [when_s for when_s, moving in reasons if moving]
    assert bool(moved) is drives
    assert not moved or moved[-1] <= FIELD.max_age_s + 1e-6


def test_a_governed_robot_stops_before_a_wall_says_why_and_backs_off():
    class Wall(NullRobot):
        def read(self):
            seen = super().read()
            return replace(seen, scan=scan((1.0 - self.state().x_m, 0.0), stamp_s=seen.scan.stamp_s))

    inner = Wall(ROSBOT)
    robot = GovernedRobot(inner)

    def step(twist):
        robot.read()
        applied = robot.drive(Command(twist, robot.now()))
        robot.wait(robot.now() + ROSBOT.period_s)
        return applied

    step(STOP)
    for _ in range(80):
        applied = step(GO)
    assert (applied.twist, applied.reason, applied.clamps) == (STOP, Reason.OBSTACLE, ("field_stop",))
    assert (applied.field_cut_m_s, applied.unhindered) == (GO.linear_m_s, GO)
    assert 0.9 - FIELD.slow_m < inner.state().x_m + BASE.length_m / 2 < 1.0 - FIELD.stop_m / 2
    assert step(Twist(0.2, 1.0)).twist.angular_rad_s == 1.0
    assert step(Twist(-0.2, 0.0)).twist.linear_m_s < 0.0
