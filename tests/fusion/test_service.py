"""The service over the bus: bad data stops the robot, is said once with its remedy, and good data makes it go on."""

import threading
import time
import uuid
from contextlib import closing, contextmanager
from dataclasses import replace

import cv2
import numpy as np
import pytest

from lira.fusion.control import ControlLoop
from lira.fusion.log.recorder import Journal
from lira.fusion.methods.base import Alone
from lira.fusion.service import serve
from lira.hal.bus.bus import Bus
from lira.hal.client.connect import open_remote
from lira.hal.messages import STOP, CompressedImage, Reason, Twist
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.testing import NullRobot
from lira.tools.launch.processes import free_port

PROFILE = load_profile("thesis-sim")
JPEG = cv2.imencode(".jpg", np.full((32, 32), 128, np.uint8))[1].tobytes()
GO = (0.5, 0.0)


class Faulty(NullRobot):
    """A robot whose sensors break in the way that `fault` names."""

    fault = ""

    def __init__(self):
        super().__init__(PROFILE, time.monotonic, time.sleep)

    def read(self):
        seen = super().read()
        data = JPEG[:-20] if self.fault == "truncated" else JPEG
        seen = replace(seen, image=CompressedImage(seen.image.stamp_s, data))
        if self.fault == "short":
            return replace(seen, scan=replace(seen.scan, ranges=seen.scan.ranges[:50]))
        return replace(seen, scan=None) if self.fault == "silent" else seen


@contextmanager
def on_the_bus(inner):
    """Serve a robot from a thread, and open it from the other end."""
    name, endpoint, stop = f"t{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}", threading.Event()
    robot_bus, bus = Bus(name, listen=endpoint), Bus(name, connect=endpoint)
    server = threading.Thread(target=HalServer(GovernedRobot(inner), robot_bus, inner).run, args=[stop])
    server.start()
    try:
        with closing(open_remote(bus)) as robot:
            yield robot
    finally:
        stop.set()
        server.join(10.0)
        assert bus.close()
        assert robot_bus.close()


def wait_for(condition, timeout_s=5.0):
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, "never happened"
        time.sleep(0.01)


def test_bad_data_on_the_bus_stops_the_robot_is_said_and_good_data_makes_it_go_on():
    inner, said, stop = Faulty(), [], threading.Event()
    with on_the_bus(inner) as robot:
        wait_for(lambda: robot.read().scan is not None and robot.read().image is not None)
        loop = ControlLoop(robot)
        loop.arm()
        words = [loop, Alone("novice", lambda _: GO), Journal(), stop, said.append]
        service = threading.Thread(target=serve, args=words)
        service.start()
        try:
            for fault, line in {
                "short": "standing still: the scan has the wrong length: 50 beams",
                "truncated": "standing still: a truncated jpeg image",
                "silent": "standing still: nothing new from the lidar",
            }.items():
                wait_for(lambda: inner.state().linear_m_s == 0.5)
                heard = len(said)
                inner.fault = fault
                wait_for(lambda: inner.state().linear_m_s == 0.0)
                wait_for(lambda heard=heard: len(said) > heard)
                assert said[heard].startswith(line)
                inner.fault = ""
                wait_for(lambda heard=heard: len(said) > heard + 1)
                assert said[heard + 1 :] == ["driving"]
            wait_for(lambda: inner.state().linear_m_s == 0.5)
            assert service.is_alive()
        finally:
            stop.set()
            service.join(5.0)


class Held(NullRobot):
    """A robot that is held for the reasons given, one a step, and stops the service after the last."""

    def __init__(self, reasons, stop):
        super().__init__(PROFILE)
        self.reasons, self.stop = list(reasons), stop

    def drive(self, command):
        reason = self.reasons.pop(0)
        if not self.reasons:
            self.stop.set()
        return replace(super().drive(command), twist=STOP, reason=reason)


@pytest.mark.parametrize("reason", [reason for reason in Reason if reason is not Reason.OK])
def test_whatever_holds_the_robot_is_said_once_with_what_to_do(reason):
    stop, said = threading.Event(), []
    robot = Held([Reason.OK, reason, reason, Reason.OK, Reason.OK], stop)
    explain = lambda applied: f"because of {applied.reason}"  # noqa: E731
    serve(ControlLoop(robot), Alone("novice", lambda _: GO), Journal(), stop, said.append, explain=explain)
    assert said == [f"because of {reason}", "driving"]


def test_every_step_is_written_down_and_counted_as_training():
    stop, written, twists = threading.Event(), [], []

    class Short(NullRobot):
        def drive(self, command):
            twists.append(command.twist)
            if len(twists) == 3:
                stop.set()
            return super().drive(command)

    journal = Journal(write=written.append)
    serve(ControlLoop(Short(PROFILE)), Alone("camera", lambda _: GO), journal, stop, print)
    assert twists == [Twist(0.5, 0.0)] * 3
    assert [record.decision.driver for record in written] == ["camera"] * 3
    assert {record.decision.phase for record in written} == {"train"}


class Eager(Alone):
    begins_alone = True


@pytest.mark.parametrize(("looks", "moves"), [([False, False, True], 1), ([False, False, False], 0)])
def test_a_method_that_begins_by_itself_stands_until_a_hand_is_there(looks, moves):
    stop, told, twists = threading.Event(), list(looks), []

    class Told(NullRobot):
        def drive(self, command):
            twists.append(command.twist)
            if len(twists) > len(looks):
                stop.set()
            return super().drive(command)

    def attended():
        return bool(told) and told.pop(0)

    serve(ControlLoop(Told(PROFILE)), Eager("plus", lambda _: GO), Journal(), stop, print, is_attended=attended)
    assert all(twist == STOP for twist in twists[: len(looks)])
    assert sum(twist != STOP for twist in twists) == moves
