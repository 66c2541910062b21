"""The protective field: what the lidar sees ahead slows and stops, the way back stays free."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hal.field import limit_speed, measure_clearance
from hal.governed import GovernedRobot
from hal.messages import STOP, Command, LaserScan, Reason, Twist
from hal.null import NullRobot
from hal.profile import load_profile

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


def test_without_a_fresh_scan_it_does_not_drive():
    free = clearance(scan())
    assert limit_speed(FIELD, free, 0.2, FIELD.max_age_s) == (0.2, "")
    assert limit_speed(FIELD, free, 0.2, FIELD.max_age_s + 0.1) == (0.0, "field_blind")
    assert limit_speed(FIELD, None, 0.2, 0.0) == (0.0, "field_blind")
    assert limit_speed(FIELD, None, 0.0, 0.0) == (0.0, "")


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
    assert 0.9 - FIELD.slow_m < inner.state().x_m + BASE.length_m / 2 < 1.0 - FIELD.stop_m / 2
    assert step(Twist(0.2, 1.0)).twist.angular_rad_s == 1.0
    assert step(Twist(-0.2, 0.0)).twist.linear_m_s < 0.0
