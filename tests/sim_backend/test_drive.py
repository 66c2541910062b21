import math

import msgspec
import numpy as np
import pytest

from lira.hal.messages import Twist
from lira.hal.profile import load_profile
from lira.sim_backend import drive
from lira.sim_backend.body import Body
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.course import Course
from lira.sim_backend.layout import build

KINEMATIC = load_profile("thesis-sim").base
WHEELS = load_profile("rosbot2").base


def go(base, start, v, w, duration_s):
    return drive.step(base, start, np.asarray(v), np.asarray(w), duration_s)


def test_kinematic_straight_arc_and_spin_are_exact():
    start = drive.motion(1.0, 2.0, 0.5)
    straight = go(KINEMATIC, start, 0.8, 0.0, 2.0)
    assert (straight.x_m, straight.y_m) == pytest.approx((1.0 + 1.6 * math.cos(0.5), 2.0 + 1.6 * math.sin(0.5)))
    arc = go(KINEMATIC, start, 1.0, 0.5, 2.0)
    assert arc.x_m == pytest.approx(1.0 + 2.0 * (math.sin(1.5) - math.sin(0.5)))
    assert arc.y_m == pytest.approx(2.0 - 2.0 * (math.cos(1.5) - math.cos(0.5)))
    assert arc.yaw_rad == pytest.approx(1.5)
    spin = go(KINEMATIC, start, 0.0, 1.0, 1.0)
    assert (spin.x_m, spin.y_m, spin.yaw_rad) == pytest.approx((1.0, 2.0, 1.5))


def test_one_kinematic_step_is_as_good_as_many():
    once = go(KINEMATIC, drive.motion(0, 0, 0), 0.7, -0.9, 1.0)
    many = drive.motion(0, 0, 0)
    for _ in range(50):
        many = go(KINEMATIC, many, 0.7, -0.9, 0.02)
    assert (once.x_m, once.y_m, once.yaw_rad) == pytest.approx((many.x_m, many.y_m, many.yaw_rad))


def test_wheels_ramp_up_at_the_firmwares_acceleration():
    half_way = go(WHEELS, drive.motion(0, 0, 0), 0.6, 0.0, 0.2)
    assert half_way.linear_m_s == pytest.approx(0.3)
    there = go(WHEELS, half_way, 0.6, 0.0, 0.4)
    assert there.linear_m_s == pytest.approx(0.6)
    # x(t) = a t^2 / 2 while it ramps; the firmware changes the speed at the beginning of each 10 ms.
    assert half_way.x_m == pytest.approx(0.5 * 1.5 * 0.2**2, abs=0.3 * 0.01)


def test_wheels_brake_at_the_same_rate():
    moving = drive.motion(0, 0, 0, 0.3, 0.0)
    assert go(WHEELS, moving, 0.0, 0.0, 0.1).linear_m_s == pytest.approx(0.15)
    assert go(WHEELS, moving, 0.0, 0.0, 0.3).linear_m_s == pytest.approx(0.0)


def test_four_wheels_turn_the_body_less_than_the_firmware_thinks():
    steady = go(WHEELS, drive.motion(0, 0, 0), 0.0, 1.0, 2.0)
    assert steady.angular_rad_s == pytest.approx(0.215 / 0.260)
    on = go(WHEELS, steady, 0.0, 1.0, 0.1)
    odometry = drive.reckon(WHEELS, drive.motion(0, 0, 0), steady, on, 0.1)
    assert odometry.angular_rad_s == pytest.approx(0.215 / 0.2378)
    assert odometry.yaw_rad == pytest.approx(0.1 * 0.215 / 0.2378)


def test_odometry_without_skid_is_the_truth():
    start, odometry = drive.motion(1.0, 2.0, 0.4), drive.motion(0, 0, 0)
    there = start
    for v, w in ((0.5, 0.9), (1.0, 0.0), (-0.3, -1.0), (0.0, 1.0)):
        after = go(KINEMATIC, there, v, w, 0.2)
        odometry = drive.reckon(KINEMATIC, odometry, there, after, 0.2)
        there = after
    dx, dy = there.x_m - 1.0, there.y_m - 2.0
    assert odometry.x_m == pytest.approx(dx * math.cos(0.4) + dy * math.sin(0.4))
    assert odometry.y_m == pytest.approx(dy * math.cos(0.4) - dx * math.sin(0.4))
    assert odometry.yaw_rad == pytest.approx(there.yaw_rad - 0.4)


def test_no_wheel_turns_faster_than_the_firmware_lets_it():
    fast = msgspec.structs.replace(WHEELS, max_linear_m_s=2.0, acceleration_m_s2=100.0)
    there = go(fast, drive.motion(0, 0, 0), 1.0, 1.0, 1.0)
    # The right wheel would need 1.1075 m/s and gets 1.0, the left one 0.8925 m/s.
    assert there.linear_m_s == pytest.approx((1.0 + 0.8925) / 2)


def test_many_robots_at_once_are_as_one_by_one():
    v, w = np.array([0.1, 0.2, -0.2]), np.array([1.0, -3.0, 0.0])
    start = drive.Motion(*(np.zeros(3) for _ in range(5)))
    together = drive.step(WHEELS, start, v, w, 0.2)
    for index in range(3):
        alone = go(WHEELS, drive.motion(0, 0, 0), v[index], w[index], 0.2)
        assert float(alone.x_m) == together.x_m[index]
        assert float(alone.yaw_rad) == together.yaw_rad[index]


def body(base, world="eight"):
    return Body(base, Course(build(load_world(world)), 0.15))


def test_the_firmware_stops_by_itself_one_second_after_the_last_command():
    wheels = body(WHEELS)
    wheels.command(Twist(0.15, 0.0))
    wheels.advance(0.9)
    assert wheels.state().linear_m_s == pytest.approx(0.15)
    wheels.advance(1.05)
    assert 0.0 < wheels.state().linear_m_s < 0.15
    wheels.advance(1.2)
    assert wheels.state().linear_m_s == 0.0


def test_time_is_worked_out_alike_in_long_and_short_advances():
    for base in (KINEMATIC, WHEELS):
        long, short = body(base), body(base)
        for each in (long, short):
            each.command(Twist(0.2, 0.5))
        long.advance(0.8)
        for tick in range(1, 81):
            short.advance(tick * 0.01)
        a, b = long.state(), short.state()
        assert (a.x_m, a.y_m, a.yaw_rad, a.progress_m) == pytest.approx((b.x_m, b.y_m, b.yaw_rad, b.progress_m))


def test_who_asks_often_and_who_asks_once_are_told_the_same():
    """Between two looks of the referee nothing is worked out but the motion."""
    for start_m in np.arange(0.0, 30.0, 1.1).tolist():
        asked, left = body(KINEMATIC, "line-obstacles"), body(KINEMATIC, "line-obstacles")
        for each in (asked, left):
            each.put_down(start_m, 0.1, 0.3)
            each.command(Twist(1.0, -0.4))
        for tick in range(1, 25):
            asked.advance(tick * 0.05)
            left.advance(tick * 0.05)
            asked.state()
        one, other = asked.state(), left.state()
        assert (one.x_m, one.y_m, one.yaw_rad, one.collided) == (other.x_m, other.y_m, other.yaw_rad, other.collided)
        assert (one.clearance_m, one.lateral_m) == (other.clearance_m, other.lateral_m)
        assert one.clearance_m == asked.course.clearance(asked.motion.xy)


def test_a_box_blocks_and_the_collision_latches():
    robot = body(KINEMATIC, "forest")  # a box of 0.45 m stands 4 m ahead
    robot.command(Twist(1.0, 0.0))
    robot.advance(6.0)
    stuck = robot.state()
    assert stuck.collided
    assert stuck.x_m == pytest.approx(4.0 - 0.225 - 0.15, abs=0.011)
    assert 0.0 <= stuck.clearance_m < 0.011
    assert stuck.linear_m_s == 0.0
    robot.command(Twist(-1.0, 0.0))
    robot.advance(7.0)
    away = robot.state()
    assert away.x_m == pytest.approx(stuck.x_m - 1.0)
    assert away.collided
    robot.put_down(0.0, 0.0, 0.0)
    assert not robot.state().collided


def test_a_long_wait_does_not_jump_through_a_box():
    robot = body(KINEMATIC, "forest")
    robot.command(Twist(1.0, 0.0))
    robot.advance(30.0)
    assert robot.state().x_m < 4.0


def test_a_grazing_pass_is_no_collision():
    robot = body(KINEMATIC, "forest")
    robot.put_down(0.0, 0.225 + 0.15 + 0.005, 0.0)
    robot.command(Twist(1.0, 0.0))
    robot.advance(4.2)
    assert robot.state().x_m == pytest.approx(4.2)
    assert not robot.state().collided


def test_leaving_the_line_is_noticed_and_latches():
    robot = body(KINEMATIC, "line")
    robot.put_down(10.0, 0.0, math.pi / 2)
    robot.command(Twist(1.0, 0.0))
    robot.advance(1.4)
    assert not robot.state().lost
    robot.advance(2.0)
    assert robot.state().lost
    robot.command(Twist(-1.0, 0.0))
    robot.advance(4.0)
    assert robot.state().lost
    assert abs(robot.state().lateral_m) < 0.1


@pytest.mark.parametrize(("began_m", "finished"), [(0.0, True), (None, False)])
def test_who_is_put_down_again_within_a_lap_goes_on_with_it(began_m, finished):
    robot = body(KINEMATIC, "eight")
    robot.put_down(robot.course.layout.curve.length_m - 0.5, 0.0, 0.0, began_m)
    assert not robot.state().finished
    robot.command(Twist(1.0, 0.0))
    robot.advance(1.0)
    assert robot.state().finished == finished


def test_without_a_line_there_is_no_progress_but_an_end():
    robot = body(KINEMATIC, "forest")
    robot.put_down(41.0, 0.0, 0.0)
    assert math.isnan(robot.state().progress_m)
    assert math.isnan(robot.state().lateral_m)
    assert not robot.state().finished
    robot.command(Twist(1.0, 0.0))
    robot.advance(1.2)
    assert robot.state().finished


def test_whoever_is_put_down_into_a_box_has_collided_and_can_leave():
    robot = body(KINEMATIC, "forest")
    robot.put_down(4.3, 0.0, 0.0)
    assert robot.state().collided
    robot.advance(1.0)
    robot.command(Twist(1.0, 0.0))
    robot.advance(2.0)
    assert robot.state().x_m == pytest.approx(5.3)


@pytest.mark.parametrize("base", [KINEMATIC, WHEELS])
def test_a_path_is_the_same_to_the_bit_as_step_after_step(base):
    start = drive.Motion(*(np.full(3, value) for value in (1.0, 2.0, 0.5, 0.3, -0.2)))
    linear, angular = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 3, 5))
    angular[0] = 0.0
    path = drive.path(base, start, linear, angular, 0.1)
    for k in range(5):
        start = drive.step(base, start, linear[:, k], angular[:, k], 0.1)
        assert [values[:, k].tolist() for values in path.arrays] == [values.tolist() for values in start.arrays]
