"""The governed robot on its own clock, without threads or waiting."""

import math
import threading

import pytest

from lira.hal.messages import STOP, Command, Reason, Source, Twist
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.testing import NullRobot

PROFILE = load_profile("thesis-sim")
GO = Twist(0.5, 0.0)


@pytest.fixture
def null():
    return NullRobot(PROFILE)


@pytest.fixture
def robot(null):
    governed = GovernedRobot(null)
    governed.open()
    yield governed
    governed.close()


def test_the_watchdog_works_on_the_robots_own_time(null, robot):
    robot.drive(Command(STOP, 0.0))
    assert robot.drive(Command(GO, 0.0)).twist == GO
    robot.wait(0.5)
    assert robot.now() == 0.5
    assert null.state().linear_m_s == 0.0
    assert null.state().x_m == pytest.approx(0.5 * PROFILE.control.policy_timeout_s)
    assert robot.tick().reason is Reason.STALE


def test_a_loop_at_the_control_rate_drives_on(null, robot):
    robot.drive(Command(STOP, 0.0))
    for _ in range(20):
        assert robot.drive(Command(GO, robot.now())).twist == GO
        robot.wait(robot.now() + PROFILE.period_s)
    assert null.state().x_m == pytest.approx(0.5 * 20 * PROFILE.period_s)


def test_a_teacher_at_the_control_rate_drives_on_and_hands_back(robot):
    robot.drive(Command(STOP, 0.0))
    turn = Twist(0.5, 0.5)
    for step in range(30):
        now_s = robot.now()
        if step % 10 < 5:
            robot.drive(Command(turn, now_s, Source.TELEOP))
        elif step % 10 == 5:
            robot.drive(Command(STOP, now_s, Source.TELEOP, released=True))
        applied = robot.drive(Command(GO, now_s))
        assert applied.twist == (turn if step % 10 < 5 else GO)
        robot.wait(now_s + PROFILE.period_s)


def test_refusals_are_counted(robot):
    robot.drive(Command(Twist(math.nan, 0.0), 0.0))
    assert robot.refused == {"not finite": 1}


def test_halt_and_close_stop_the_wheels(null):
    robot = GovernedRobot(null)
    robot.drive(Command(STOP, 0.0))
    robot.drive(Command(GO, 0.0))
    assert robot.halt().reason is Reason.NO_COMMAND
    assert null.state().linear_m_s == 0.0
    robot.drive(Command(STOP, 0.0))
    robot.drive(Command(GO, 0.0))
    assert null.state().linear_m_s == 0.5
    robot.close()
    robot.close()
    assert null.state().linear_m_s == 0.0


def test_a_sensor_that_never_answers_does_not_keep_the_watchdog_waiting():
    entered, leave = threading.Event(), threading.Event()

    class Stuck(NullRobot):
        def read(self):
            entered.set()
            leave.wait(10.0)
            return super().read()

    robot = GovernedRobot(Stuck(PROFILE))
    reader = threading.Thread(target=robot.read)
    reader.start()
    assert entered.wait(5.0)
    robot.drive(Command(STOP, 0.0))
    assert robot.drive(Command(GO, 0.0)).twist == GO
    assert robot.halt().twist == STOP
    leave.set()
    reader.join()


def test_what_the_base_cuts_is_reported():
    class Weak(NullRobot):
        def drive(self, command):
            half = Twist(command.twist.linear_m_s / 2, command.twist.angular_rad_s)
            applied = super().drive(Command(half, command.stamp_s, command.source))
            return applied if half == command.twist else type(applied)(half, applied.stamp_s, clamps=("base",))

    robot = GovernedRobot(Weak(PROFILE))
    robot.drive(Command(STOP, 0.0))
    applied = robot.drive(Command(Twist(9.0, 0.0), 0.0))
    assert applied.twist == Twist(PROFILE.base.max_linear_m_s / 2, 0.0)
    assert applied.clamps == ("linear", "base")


class Switched(NullRobot):
    """A robot whose motors have a switch; notes what it was told, and how fast the wheels went then."""

    def __init__(self):
        super().__init__(PROFILE)
        self.told = []

    def cut_motors(self, off):
        self.told.append((off, self.state().linear_m_s))


def test_the_emergency_stop_takes_the_motors_power_after_the_zero_and_the_release_gives_it_back():
    switched = Switched()
    robot = GovernedRobot(switched)
    robot.drive(Command(STOP, 0.0))
    robot.drive(Command(GO, 0.0))
    robot.press_estop()
    assert switched.told == [(True, 0.0)]
    robot.tick()
    robot.halt()
    robot.press_estop()
    assert switched.told == [(True, 0.0)]
    robot.release_estop()
    assert switched.told == [(True, 0.0), (False, 0.0)]
    assert robot.drive(Command(GO, 0.0)).reason is Reason.NEUTRAL_FIRST
