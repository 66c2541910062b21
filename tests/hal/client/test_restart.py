"""A robot that is started anew while it is driven: its clock is another one, and nothing of the old one counts."""

import threading
import time
from collections import deque
from contextlib import ExitStack, closing

import numpy as np
import pytest

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.boundary import Boundary
from lira.hal.bus.reader import Received
from lira.hal.bus.services import REALTIME, Info
from lira.hal.bus.topics import APPLIED, SCAN
from lira.hal.client.realtime import RealTimeRobot
from lira.hal.clock import SILENT_S
from lira.hal.errors import BusError
from lira.hal.messages import HELD, STOP, Applied, Command, LaserScan, Reason, Source, Twist, session_of
from lira.hal.profile import load_profile

OLD, NEW = 1000.0, 3.0  # what the clocks say
GO = Twist(0.5, 0.0)


class FakeBus:
    """What a remote robot asks of a bus; the test says what comes and looks at what is sent."""

    def __init__(self):
        self.epoch, self.queues, self.sent = 99, {}, []
        self.info = Info(load_profile("thesis-sim"), REALTIME, 0)
        self.boundary = Boundary()
        self.began_s = time.monotonic()

    def reader(self, topic, depth=1):
        return FakeReader(self.queues.setdefault(topic.key, deque()))

    def publisher(self, topic, *_):
        return FakePublisher(self, topic.key)

    def ask(self, *_, **__):
        return self.info.to_json()

    def say(self, topic, message, epoch, time_s):
        attachment = Attachment(epoch, 1, round(time_s * 1e9), -1, False)
        self.queues[topic.key].append(Received(message, attachment, time.monotonic()))


class FakeReader:
    def __init__(self, queue):
        self._queue, self._newest = queue, None

    def poll(self):
        found = [self._queue.popleft() for _ in range(len(self._queue))]
        if found:
            self._newest = found[-1]
        return found

    def newest(self):
        self.poll()
        return self._newest


class FakePublisher:
    def __init__(self, bus, key):
        self._bus, self._key = bus, key

    def put(self, message, time_s, **_):
        self._bus.sent.append((self._key, message, time_s))


class FakeRobot:
    """Says from a thread what it applied, 50 times a second, as the robot of one start."""

    def __init__(self, bus, epoch, clock_s, reason=Reason.OK, twist=GO):
        self._bus, self._epoch, self._reason, self._twist = bus, epoch, reason, twist
        self._offset_s = clock_s - time.monotonic()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def now(self):
        return time.monotonic() + self._offset_s

    def _run(self):
        while not self._stop.wait(0.02):
            now_s = self.now()
            applied = Applied(self._twist, now_s, Source.POLICY, self._reason, session=session_of(self._bus.epoch))
            self._bus.say(APPLIED, applied, self._epoch, now_s)

    def kill(self):
        self._stop.set()
        self._thread.join()


@pytest.fixture
def bus():
    return FakeBus()


@pytest.fixture
def opened(bus):
    with ExitStack() as stack:
        yield lambda: stack.enter_context(closing(RealTimeRobot(bus, bus.info)))


def wait_for(condition, timeout_s=3.0):
    until_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < until_s, "never happened"
        time.sleep(0.005)


def test_a_wait_on_the_old_clock_ends_with_it(bus, opened):
    first = FakeRobot(bus, 7, OLD)
    remote = opened()
    ended = threading.Event()
    waiting = threading.Thread(target=lambda: (remote.wait(remote.now() + 3600.0), ended.set()))
    waiting.start()
    assert not ended.wait(0.2)
    first.kill()
    time.sleep(SILENT_S)
    second = FakeRobot(bus, 8, NEW)
    assert ended.wait(2.0)
    second.kill()
    waiting.join()
    assert remote.started_anew()
    assert not remote.started_anew()  # that was told
    assert remote.now() == pytest.approx(second.now(), abs=0.2)


def test_what_was_decided_and_seen_before_is_not_said_nor_read_after(bus, opened):
    first = FakeRobot(bus, 7, NEW)  # both clocks are near each other: the times alone would not tell
    remote = opened()
    bus.say(SCAN, LaserScan(first.now(), 0.0, 0.1, 0.1, 5.0, np.ones(3, np.float32)), 7, first.now())
    assert remote.read().scan is not None
    remote.drive(Command(GO, remote.now(), answers=1))
    wait_for(lambda: len(bus.sent) > 2)  # it is repeated
    first.kill()
    time.sleep(SILENT_S)
    second = FakeRobot(bus, 8, NEW + 0.5, Reason.NO_COMMAND, STOP)
    wait_for(remote.started_anew)
    bus.sent.clear()
    time.sleep(0.2)
    assert bus.sent == []
    bus.say(SCAN, LaserScan(second.now(), 0.0, 0.1, 0.1, 5.0, np.ones(3, np.float32)), 7, second.now())
    assert remote.read().scan is None
    bus.say(SCAN, LaserScan(second.now(), 0.0, 0.1, 0.1, 5.0, np.ones(3, np.float32)), 8, second.now())
    assert remote.read().scan is not None
    second.kill()


def test_the_first_neutral_decision_does_not_arm_a_robot_that_was_started_anew(bus, opened):
    first = FakeRobot(bus, 7, OLD)
    remote = opened()
    first.kill()
    time.sleep(SILENT_S)
    second = FakeRobot(bus, 8, NEW, Reason.NO_COMMAND, STOP)
    wait_for(remote.started_anew)
    time.sleep(0.1)
    bus.sent.clear()
    assert remote.drive(Command(STOP, remote.now(), answers=1)).reason in HELD
    assert bus.sent == []
    remote.drive(Command(STOP, remote.now(), answers=2))  # now that the caller knows, it is a decision
    assert bus.sent
    second.kill()


def test_who_speaks_between_the_words_of_the_robot_is_not_listened_to(bus, opened):
    robot = FakeRobot(bus, 7, OLD)
    remote = opened()
    for _ in range(20):
        bus.say(APPLIED, Applied(STOP, 5.0, Source.POLICY), 8, 5.0)
        time.sleep(0.01)
    assert not remote.started_anew()
    assert remote.now() == pytest.approx(robot.now(), abs=0.2)
    robot.kill()


def test_another_robot_that_comes_in_its_place_is_not_driven(bus, opened):
    first = FakeRobot(bus, 7, OLD)
    remote = opened()
    first.kill()
    bus.info = Info(load_profile("rosbot2"), REALTIME, 8)
    time.sleep(SILENT_S)
    second = FakeRobot(bus, 8, NEW)
    try:
        with pytest.raises(BusError, match=r"'rosbot2' \(realtime\) came back in place of 'thesis-sim'"):
            wait_for(remote.started_anew)
    finally:
        second.kill()


def test_a_robot_that_is_never_heard_is_an_error_and_leaves_no_thread(bus, opened, monkeypatch):
    monkeypatch.setattr("lira.hal.client.realtime.HEAR_S", 0.1)
    with pytest.raises(BusError, match="says nothing"):
        opened()
    wait_for(lambda: not any(thread.name.startswith("remote-") for thread in threading.enumerate()))
