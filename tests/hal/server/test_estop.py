"""The emergency stop over the bus, and one commander at a time."""

from wiring import StuckRobot, joined, real_time_null, remote, served, wait_for

from lira.hal.bus.services import look_at_estop, press_estop, release_estop
from lira.hal.bus.topics import ESTOP
from lira.hal.messages import STOP, Bool, Command, Reason, Twist
from lira.hal.testing import NullRobot

GO = Twist(0.5, 0.0)


def drive_until(client, twist, wanted, timeout_s=5.0):
    wait_for(lambda: wanted(client.drive(Command(twist, client.now()))), timeout_s)


def get_going(client):
    drive_until(client, STOP, lambda applied: applied.reason is Reason.OK)
    drive_until(client, GO, lambda applied: applied.twist == GO)


def test_anybody_stops_it_and_it_moves_only_after_release_and_neutral():
    with served(real_time_null()) as robot, remote(robot) as client, joined(robot) as anybody:
        get_going(client)
        assert press_estop(anybody).pressed
        assert robot.inner.state().linear_m_s == 0.0
        for twist in (GO, STOP, GO):
            drive_until(client, twist, lambda applied: applied.reason is Reason.ESTOP)
        assert look_at_estop(anybody).pressed
        assert release_estop(anybody).state == "stopped"
        drive_until(client, GO, lambda applied: applied.reason is Reason.NEUTRAL_FIRST)
        get_going(client)


def test_the_latched_topic_presses_even_before_the_robot_is_there_and_false_releases_nothing():
    with served(real_time_null()) as robot, joined(robot) as anybody:
        button = anybody.publisher(ESTOP)
        button.put(Bool(True), 0.0)
        wait_for(lambda: look_at_estop(anybody).pressed)
        button.put(Bool(False), 0.0)
        with remote(robot) as client:
            drive_until(client, STOP, lambda applied: applied.reason is Reason.ESTOP)
            assert look_at_estop(anybody).pressed
            release_estop(anybody)
            get_going(client)


def test_the_emergency_stop_answers_while_a_sensor_hangs():
    with served(real_time_null(StuckRobot)) as robot, remote(robot) as client:
        get_going(client)
        robot.inner.hang()
        assert press_estop(client.bus).pressed
        assert robot.inner.state().linear_m_s == 0.0
        robot.inner.go_on()


def test_in_lockstep_it_holds_too():
    with served(NullRobot(real_time_null().profile), lockstep=True) as robot, remote(robot) as client:

        def step(twist):
            applied = client.drive(Command(twist, client.now(), answers=client.read().seq))
            client.wait(client.now() + client.profile.period_s)
            return applied

        step(STOP)
        assert step(GO).twist == GO
        press_estop(client.bus)
        assert step(GO).reason is Reason.ESTOP
        release_estop(client.bus)
        step(STOP)
        step(STOP)
        assert step(GO).twist == GO


def test_a_second_commander_is_refused_until_the_first_leaves():
    with served(real_time_null()) as robot, remote(robot) as first:
        get_going(first)
        with remote(robot) as second:
            second.drive(Command(STOP, second.now()))
            wait_for(lambda: look_at_estop(first.bus).refused.get("another commander", 0) > 0)
            drive_until(first, GO, lambda applied: applied.twist == GO)
            first.close()
            wait_for(lambda: robot.inner.state().linear_m_s == 0.0)
            get_going(second)
