"""A device that was lost, for however short a time, is told to the governor, which then waits for somebody's zero."""

import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lira.hal.bus.boundary import Boundary
from lira.hal.bus.reader import Received
from lira.hal.errors import DeviceError
from lira.hal.messages import STOP, Command, CompressedImage, LaserScan, Odometry, Reason, Twist
from lira.hal.profile import load_profile
from lira.hal.safety.governed import FIELD_OFF, GovernedRobot
from lira.robot.core2.board import Readings
from lira.robot.ros2.robot import Interface, Ros2Robot
from lira.robot.rosbot import BLIND_S, Devices, Rosbot
from lira.robot.supervisor import Supervisor

PROFILE = load_profile("rosbot2")
GO = Twist(0.2, 0.0)
TICK_S = 0.02
SCAN = LaserScan(0.0, -np.pi, np.pi / 200, 0.15, 12.0, np.full(400, np.inf, np.float32))


class Base:
    """A base that does as told, and answers while it is told to."""

    def __init__(self):
        self.answers, self.losses, self.readings, self.twist = True, 0, Readings(), STOP

    def drive(self, twist, decided_s=0.0):
        self.twist = twist

    def lose(self):
        self.answers, self.losses = False, self.losses + 1

    def cut_motors(self, off):
        pass


class Still(Rosbot):
    """The physical robot without its threads: its devices say what the test has them say, when the test says so."""

    def __init__(self, lidar="/dev/null"):
        super().__init__(PROFILE, Devices("/dev/null", lidar))
        self.base, self.time_s, self.scanning, self.near = Base(), 100.0, True, False
        self._open = True
        for supervisor in self._supervisors.values():
            supervisor._begin()

    def now(self):
        return self.time_s

    def wait(self, until_s):
        self.time_s = until_s

    def scan(self):
        ranges = SCAN.ranges.copy()
        ranges[200] = 0.157 if self.near else np.inf
        self._see_scan(replace(SCAN, stamp_s=self.time_s, ranges=ranges))


def keep(robot, twist, seconds):
    """Command at 50 Hz, with a scan at 10 Hz; returns all that was applied."""
    still, applied = robot.still, []
    for step in range(round(seconds / TICK_S)):
        if still.scanning and step % 5 == 0:
            still.scan()
        robot.read()
        applied.append(robot.drive(Command(twist, still.time_s)))
        assert still.base.twist == applied[-1].twist
        still.wait(still.time_s + TICK_S)
    return applied


@pytest.fixture
def robot():
    still = Still()
    still.scan()
    robot = GovernedRobot(still)
    robot.still = still
    keep(robot, STOP, 0.2)
    assert keep(robot, GO, 1.0)[-1].twist == GO
    return robot


def stands(robot, seconds):
    applied = keep(robot, GO, seconds)
    assert {each.twist for each in applied} == {STOP}
    return applied[-1]


def goes_after_a_zero(robot):
    keep(robot, STOP, 0.1)
    return keep(robot, GO, 1.0)[-1].twist == GO


def test_a_person_who_steps_before_a_robot_that_lost_its_base_and_away_again_does_not_set_it_off(robot):
    robot.still.base.lose()
    lost = stands(robot, 0.5)
    assert (lost.reason, lost.clamps) == (Reason.STALE, ("no_base",))
    robot.still.base.answers = True
    assert stands(robot, 0.5).reason is Reason.NEUTRAL_FIRST
    robot.still.near = True
    stands(robot, 1.0)
    robot.still.near = False
    assert stands(robot, 1.0).reason is Reason.NEUTRAL_FIRST
    assert goes_after_a_zero(robot)


def test_a_scan_that_comes_back_just_before_the_next_look_does_not_set_it_off(robot):
    robot.still.scanning = False
    for _ in range(round((BLIND_S + 0.1) / TICK_S)):  # nobody looks meanwhile: the loss itself is never seen
        robot.still.wait(robot.still.time_s + TICK_S)
    robot.still.scan()
    robot.submit(Command(GO, robot.still.time_s))
    assert robot.tick().twist == STOP
    robot.still.scanning = True
    assert stands(robot, 1.0).reason is Reason.NEUTRAL_FIRST
    assert goes_after_a_zero(robot)


def test_a_lidar_that_is_silent_is_lost_and_back_with_its_scan(robot):
    robot.still.scanning = False
    applied = keep(robot, GO, 1.5)
    assert (applied[-1].twist, applied[-1].clamps) == (STOP, ("no_lidar",))
    robot.still.scanning = True
    assert stands(robot, 1.0).reason is Reason.NEUTRAL_FIRST
    assert goes_after_a_zero(robot)


def test_a_board_negotiated_anew_between_two_looks_stops_it(robot):
    robot.still.base.losses += 1
    assert stands(robot, 0.5).reason is Reason.NEUTRAL_FIRST
    assert goes_after_a_zero(robot)


def test_without_a_lidar_the_field_is_off_and_that_is_said():
    still = Still(lidar=None)
    robot = GovernedRobot(still)
    robot.still = still
    still.scanning = False
    assert robot.field_off == FIELD_OFF
    assert robot.profile.field is None
    assert goes_after_a_zero(robot)


def test_with_a_lidar_the_field_is_on(robot):
    assert robot.field_off == ""
    assert robot.profile == PROFILE


def test_a_keeper_counts_what_worked_and_was_lost():
    ends, begun = threading.Event(), threading.Semaphore(0)
    sessions = iter(["fails", "works", "works"])

    def session(stop, begin):
        if next(sessions, "works") == "works":
            begin()
            begun.release()
            ends.wait(5.0)
            ends.clear()
        if not stop.is_set():
            raise DeviceError("gone")

    supervisor = Supervisor("thing", session)
    supervisor.start()
    assert begun.acquire(timeout=5.0)
    assert supervisor.losses == 0  # what never worked is not lost
    ends.set()
    assert begun.acquire(timeout=5.0)
    assert supervisor.losses == 1
    ends.set()
    supervisor.close()


class FarBus:
    """The other robot's topics, put by hand."""

    def __init__(self):
        self.queues, self.sent, self.boundary = {}, [], Boundary()

    def reader(self, topic):
        queue = self.queues.setdefault(topic.key, [])
        return SimpleNamespace(poll=lambda: [queue.pop(0) for _ in range(len(queue))])

    def publisher(self, _topic):
        return SimpleNamespace(put=lambda message, _time_s: self.sent.append(message))


class Far:
    """A ROS 2 robot whose clock is 1000 s ahead of ours; `robot` reads it."""

    def __init__(self, monkeypatch):
        self.local_s = 50.0
        clock = SimpleNamespace(monotonic=lambda: self.local_s, sleep=lambda _: None)
        monkeypatch.setattr("lira.robot.ros2.robot.time", clock)
        self.bus = FarBus()
        self.robot = Ros2Robot(PROFILE, self.bus, Interface())
        self.send()
        self.robot.open()

    def put(self, key, message):
        self.bus.queues[key].append(Received(message, None, self.local_s))

    def show(self, camera_ahead_s=0.0):
        self.send(camera_ahead_s)
        self.robot.read()

    def send(self, camera_ahead_s=0.0):
        now_s = self.local_s + 1000.0
        self.put("odom", Odometry(now_s, 0.0, 0.0, 0.0, 0.0, 0.0))
        self.put("scan", replace(SCAN, stamp_s=now_s))
        self.put("camera/color/image_raw/compressed", CompressedImage(now_s + camera_ahead_s, b"\xff\xd8"))


def test_a_silence_of_a_ros_2_robot_is_a_loss_also_when_nobody_looked(monkeypatch):
    far = Far(monkeypatch)
    assert far.robot.device_health().lost == ()
    before = far.robot.device_health().losses
    far.local_s += 0.4
    far.show()
    assert far.robot.device_health().losses == before
    far.local_s += 0.6
    far.show()
    health = far.robot.device_health()
    assert health.lost == ()
    assert health.losses > before
    far.local_s += 0.6
    assert far.robot.device_health().lost == ("lidar", "camera")


@pytest.mark.parametrize(("ahead_s", "lost"), [(0.2, ()), (5.0, ("camera",))])
def test_a_picture_of_a_ros_2_robot_from_the_future_counts_from_now_or_not_at_all(monkeypatch, ahead_s, lost):
    far = Far(monkeypatch)
    far.show(ahead_s)
    assert far.robot.device_health().lost == lost
    picture = far.robot.read().image
    assert (picture is None) is bool(lost)
    assert picture is None or picture.stamp_s == far.robot.now()
