"""The HAL server in real time: whatever fails, the wheels get zero, and nothing fails silently."""

import threading
import time

import msgspec
import pytest
import zenoh
from wiring import PROFILE, StuckRobot, joined, new_endpoint, new_name, real_time_null, remote, served, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.topics import APPLIED, CMD_VEL, DEPTH
from lira.hal.client.connect import open_remote
from lira.hal.client.realtime import DECISION_S
from lira.hal.client.remote import RemoteArena
from lira.hal.errors import BusError, DeviceError
from lira.hal.messages import STOP, Applied, Command, Episode, Reason, Source, Twist
from lira.hal.messages.compression import read_depth
from lira.hal.messages.ros.codec import encode
from lira.hal.profile import STOP_BUDGET_S, Depth
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.realtime import SWITCH_S
from lira.hal.server.server import HalServer
from lira.hal.testing import NullRobot

GO = Twist(0.5, 0.0)


def get_going(client):
    """Arm and drive until the robot says that it moves."""
    for twist in (STOP, GO):
        wait_for(lambda twist=twist: client.drive(Command(twist, client.now())).reason is Reason.OK)
    wait_for(lambda: client.drive(Command(GO, client.now())).twist == GO)


def is_still(robot):
    return robot.inner.state().linear_m_s == 0.0


def test_a_decision_is_kept_alive_and_a_hung_loop_is_not():
    with served(real_time_null()) as robot, remote(robot) as client:
        get_going(client)
        decided_s = client.now()
        client.drive(Command(GO, decided_s))
        time.sleep(0.4)  # longer than any time-out of the governor
        assert not is_still(robot)
        wait_for(lambda: is_still(robot))
        assert robot.inner.now() - decided_s < DECISION_S + STOP_BUDGET_S + 0.2
        wait_for(lambda: client.drive(Command(GO, client.now())).reason is Reason.NEUTRAL_FIRST)


def test_no_thread_of_a_robots_process_holds_the_interpreter_for_long_while_the_wheels_need_it(monkeypatch):
    asked = []
    monkeypatch.setattr("sys.setswitchinterval", asked.append)
    with served(real_time_null()):
        assert asked == [SWITCH_S]
    assert SWITCH_S <= 0.001


def test_who_has_not_heard_that_the_robot_stopped_does_not_arm_it_with_a_zero():
    with served(real_time_null()) as robot, remote(robot) as client:
        get_going(client)
        wait_for(lambda: client._newest.reason is Reason.STALE)
        told = client.drive(Command(STOP, client.now(), answers=1))
        assert told.reason is Reason.STALE
        time.sleep(0.2)
        assert robot.governed.state == "stopped"
        wait_for(lambda: client.drive(Command(STOP, client.now(), answers=1)).reason is Reason.OK)
        assert robot.governed.state == "armed"


def test_what_was_decided_before_a_reset_does_not_drive_after_it():
    with served(real_time_null()) as robot, remote(robot) as client:
        get_going(client)
        RemoteArena(client).reset(Episode())
        put_down_m = robot.inner.state().x_m
        time.sleep(DECISION_S)
        assert robot.inner.state().x_m == put_down_m
        get_going(client)


def test_a_hand_is_not_kept_alive():
    with served(real_time_null()) as robot, remote(robot) as client:
        get_going(client)
        wait_for(lambda: client.drive(Command(GO, client.now(), Source.TELEOP)).source is Source.TELEOP)
        commanded_s = robot.inner.now()
        wait_for(lambda: is_still(robot))
        # Policy's decision is still being repeated, and does not take over.
        assert robot.inner.now() - commanded_s < STOP_BUDGET_S + 0.1


def test_what_is_stale_is_none():
    with served(real_time_null()) as robot, remote(robot) as client:
        wait_for(lambda: client.read().scan is not None and client.read().odom is not None)
        robot.stop.set()
        robot.join()
        wait_for(lambda: client.read().scan is None and client.read().odom is None, 2.0)
        assert client.drive(Command(GO, client.now())).reason is Reason.NO_COMMAND


def test_a_sensor_that_never_answers_leaves_the_wheels_in_control():
    with served(real_time_null(StuckRobot)) as robot, remote(robot) as client:
        get_going(client)
        robot.inner.hang()
        time.sleep(0.1)
        assert client.drive(Command(GO, client.now())).twist == GO
        wait_for(lambda: is_still(robot), DECISION_S + STOP_BUDGET_S + 0.5)
        get_going(client)
        began_s = time.monotonic()
        robot.stop.set()
        wait_for(lambda: is_still(robot), 1.0)
        robot.join()
        assert time.monotonic() - began_s < 6.0
        robot.inner.go_on()


def test_a_bus_that_takes_nothing_leaves_the_wheels_in_control(monkeypatch):
    leave, stuck, put = threading.Event(), threading.Event(), Publisher.put

    def put_or_hang(self, message, *words, **more):
        if stuck.is_set() and isinstance(message, Applied):
            leave.wait(20.0)
        put(self, message, *words, **more)

    monkeypatch.setattr(Publisher, "put", put_or_hang)
    with served(real_time_null()) as robot, remote(robot) as client:
        get_going(client)
        stuck.set()
        client.drive(Command(GO, client.now()))
        assert not is_still(robot)
        wait_for(lambda: is_still(robot), DECISION_S + STOP_BUDGET_S + 0.5)
        assert robot.governed.state == "stopped"
        leave.set()
        get_going(client)


@pytest.mark.parametrize("method", ["read", "drive"])
def test_a_device_that_fails_stops_the_server_and_says_why(method):
    class Failing(NullRobot):
        failing = False

        def read(self):
            if self.failing and method == "read":
                raise DeviceError("the lidar is gone", "Plug it in.")
            return super().read()

        def drive(self, command):
            if self.failing and method == "drive" and command.twist != STOP:
                raise DeviceError("the base is gone", "Plug it in.")
            return super().drive(command)

    with served(real_time_null(Failing)) as robot, remote(robot) as client:
        get_going(client)
        robot.inner.failing = True
        robot.join()
        assert isinstance(robot.failure, DeviceError)
        assert robot.stop.is_set()
        assert is_still(robot)


def test_a_robot_that_does_not_open_says_why():
    class Broken(NullRobot):
        def open(self):
            raise DeviceError("no lidar", "Plug it in.")

    with served(real_time_null(Broken)) as robot:
        robot.join()
        assert isinstance(robot.failure, DeviceError)


def test_a_second_robot_of_the_same_name_is_refused():
    with served(real_time_null()) as robot:
        rival = Bus(robot.name, listen=new_endpoint())
        try:
            with pytest.raises(BusError, match=f"'{robot.name}' already runs.*another name"):
                HalServer(GovernedRobot(real_time_null()), rival).run(threading.Event())
        finally:
            rival.close()


def test_the_name_is_free_again_afterwards():
    name = new_name()
    for _ in range(2):
        bus, stop = Bus(name, listen=new_endpoint()), threading.Event()
        HalServer(GovernedRobot(real_time_null()), bus, ready=stop.set).run(stop)
        bus.close()


def test_a_ros_peer_without_attachment_drives_too():
    with served(real_time_null()) as robot, joined(robot) as bus:
        applied = bus.reader(APPLIED)

        def put(twist):
            bus._session.put(f"{robot.name}/cmd_vel", encode(twist), priority=zenoh.Priority.REAL_TIME)
            newest = applied.newest()
            return None if newest is None else newest.message

        wait_for(lambda: (got := put(STOP)) is not None and got.reason is Reason.OK)
        wait_for(lambda: put(GO).twist == GO)


def test_a_replayed_or_future_command_moves_nothing():
    with served(real_time_null()) as robot, remote(robot) as client:
        wait_for(lambda: client.drive(Command(STOP, client.now())).reason is Reason.OK)
        forger = client.bus.publisher(CMD_VEL)
        now_s = client.now()
        for time_s in (now_s - 10.0, now_s + 3600.0, now_s - 0.26):
            forger.put(GO, time_s)
        wait_for(lambda: sum(robot.governed.refused.values()) >= 3)
        assert is_still(robot)
        assert robot.inner.state().x_m == 0.0


def test_nobody_there_is_said_with_the_remedy():
    bus = Bus("nobody", connect=new_endpoint())
    try:
        with pytest.raises(BusError, match=r"no robot named 'nobody'.*lira twin"):
            open_remote(bus, answer_s=0.2)
    finally:
        bus.close()


def test_after_close_it_says_so_and_commands_nothing_more():
    with served(real_time_null()) as robot, remote(robot) as client:
        get_going(client)
        client.close()
        client.close()
        for asked in (client.now, client.read, client.state, lambda: client.drive(Command(GO, 0.0))):
            with pytest.raises(BusError, match="closed"):
                asked()
        wait_for(lambda: is_still(robot))


def test_the_profile_comes_over_the_bus():
    with served(real_time_null()) as robot, remote(robot) as client:
        assert client.profile == PROFILE


DEEP = msgspec.structs.replace(PROFILE, depth=Depth(width_px=16, height_px=12, range_min_m=0.1, range_max_m=4.0))


def test_depth_travels_at_its_own_rate_and_only_to_who_asks():
    with served(NullRobot(DEEP, time.monotonic, time.sleep)) as robot, joined(robot) as bus:
        reader = bus.reader(DEPTH, depth=64)
        wait_for(lambda: reader.newest() is not None)
        reader.poll()
        time.sleep(1.0)
        came = reader.poll()
        assert 3 <= len(came) <= 6
        assert read_depth(came[-1].message).data.shape == (12, 16)
