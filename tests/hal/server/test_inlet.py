"""What a HAL server takes in of what others send, and how much of it at once."""

import threading
import time
from types import SimpleNamespace

import pytest
import zenoh
from wiring import PROFILE, joined, paired, ready, real_time_null, remote, served, wait_for

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.boundary import Boundary
from lira.hal.bus.questions import QUESTIONS
from lira.hal.bus.reader import Reader
from lira.hal.bus.topics import CMD_VEL, ESTOP, INFO, JOY
from lira.hal.errors import BusError
from lira.hal.messages import STOP, Bool, Command, Joy, Reason, Twist
from lira.hal.messages.ros.codec import encode
from lira.hal.server.command_reader import BURST, DEPTH, ESTOP_DEPTH, Inlet, Order

GO = Twist(0.5, 0.0)


def test_a_count_that_does_not_grow_is_old_and_each_session_has_its_own():
    order = Order()
    sent = [(1, 5), (1, 6), (1, 6), (1, 5), (2, 0), (1, 7), (2, 0)]
    assert [order.is_new(epoch, seq) for epoch, seq in sent] == [
        *(True, True, False, False),
        *(True, True, False),
    ]


def test_who_sends_under_many_sessions_fills_nothing():
    order = Order()
    assert order.is_new(1, 1)
    for epoch in range(2, 5000):
        order.is_new(epoch, 1)
        order.is_new(1, epoch)
    assert len(order._highest) < 1000
    assert not order.is_new(1, 1)


@pytest.fixture
def pair():
    with paired() as buses:
        yield buses


def put(client, topic, payload, attachment=None):
    """In order, and as fast as can be."""
    client._session.put(f"{client.robot}/{topic.key}", payload, attachment=attachment)


def let_all_come(robot, client):
    """Wait until all that was put has come: what is put last overtakes nothing on the same link."""
    last = robot.reader(JOY)
    ready(client, JOY)
    put(client, JOY, encode(Joy(1.0, (), ())))
    wait_for(lambda: last.newest() is not None)


def test_a_repeated_command_renews_nothing(pair):
    robot, client = pair
    inlet = Inlet(robot, PROFILE.control)
    ready(client)
    sent = Attachment(9, 4, 10**9).to_bytes()
    for _ in range(3):
        put(client, CMD_VEL, encode(GO), sent)
    found = []
    wait_for(lambda: found.extend(inlet.policy(1.0)) or robot.boundary.counts.get(("cmd_vel", "out of order")) == 2)
    assert [command.seq for command in found] == [4]


def test_what_a_link_held_back_of_a_ros_peer_does_not_count_as_said_now(pair):
    robot, client = pair
    inlet = Inlet(robot, PROFILE.control)
    ready(client)
    for _ in range(BURST):
        put(client, CMD_VEL, encode(GO))
    let_all_come(robot, client)
    assert inlet.policy(1.0) == []
    assert robot.boundary.counts == {("cmd_vel", "burst"): BURST}
    put(client, CMD_VEL, encode(STOP))
    wait_for(lambda: [(each.twist, each.stamp_s) for each in inlet.policy(2.0)] == [(STOP, 2.0)])


def test_a_poll_ends_however_much_there_is(pair):
    robot, client = pair
    inlet, reader = Inlet(robot, PROFILE.control), robot.reader(CMD_VEL, DEPTH)
    ready(client)
    for seq in range(3 * DEPTH):
        put(client, CMD_VEL, encode(GO), Attachment(9, seq, 0).to_bytes())
    let_all_come(robot, client)
    assert len(inlet.policy(0.0)) == len(reader.poll()) == DEPTH
    assert reader.full
    assert reader.poll() == []
    assert not reader.full


class Endless:
    """A subscriber whose peer is always faster."""

    def __init__(self, payload):
        self.taken = 0
        self._sample = SimpleNamespace(payload=payload, attachment=None, key_expr="t/cmd_vel", timestamp=None)

    def try_recv(self):
        self.taken += 1
        return self._sample


class Untouchable(bytes):
    """A payload that is not to be copied."""

    def __bytes__(self):
        raise AssertionError("copied")


@pytest.mark.parametrize("payload", [encode(GO), b"garbage", Untouchable(1000)])
def test_a_poll_ends_although_there_is_always_more(payload):
    endless, boundary = Endless(payload), Boundary()
    connection = SimpleNamespace(declare=lambda _: SimpleNamespace(now=endless))
    reader = Reader(connection, "t/cmd_vel", CMD_VEL, DEPTH, boundary)
    reader.poll()
    assert endless.taken == DEPTH
    assert reader.full
    assert set(boundary.counts) <= {("cmd_vel", "undecodable"), ("cmd_vel", "too long")}


def test_a_press_among_ever_so_many_idle_messages_is_not_lost(pair):
    robot, client = pair
    inlet = Inlet(robot, PROFILE.control)
    ready(client, ESTOP)
    put(client, ESTOP, encode(Bool(False)))
    let_all_come(robot, client)
    assert not inlet.estop()
    put(client, ESTOP, encode(Bool(True)))
    for _ in range(2 * ESTOP_DEPTH):
        put(client, ESTOP, encode(Bool(False)))
    let_all_come(robot, client)
    assert inlet.estop()


def test_a_press_that_is_shown_again_presses_once_whatever_came_between(pair):
    robot, client = pair
    inlet = Inlet(robot, PROFILE.control)
    ready(client, ESTOP)
    press = Attachment(9, 1, 0).to_bytes()
    put(client, ESTOP, encode(Bool(True)), press)
    wait_for(inlet.estop)
    for seq in range(2, 300):
        put(client, ESTOP, encode(Bool(False)), Attachment(9, seq, 0).to_bytes())
        time.sleep(0.001)
        assert not inlet.estop()
    put(client, ESTOP, encode(Bool(True)), press)
    let_all_come(robot, client)
    assert not inlet.estop()


def test_what_is_too_long_does_not_even_come(pair):
    robot, client = pair
    reader = robot.reader(CMD_VEL, DEPTH)
    publisher = ready(client)
    for size in (CMD_VEL.max_bytes + 1, 10_000, 1_000_000, 20_000_000):
        put(client, CMD_VEL, encode(GO) + bytes(size - 52))
    put(client, CMD_VEL, encode(GO), bytes(10_000))
    publisher.put(STOP, 0.0)
    wait_for(lambda: (newest := reader.newest()) is not None and newest.message == STOP)
    assert set(robot.boundary.counts) <= {("cmd_vel", "too long")}


def test_nobody_answers_and_nothing_fills_or_waits(pair):
    robot, client = pair
    questions, reader = robot.questions(INFO), robot.reader(CMD_VEL)
    publisher = ready(client)
    for _ in range(4 * QUESTIONS):
        client._session.get(f"{client.robot}/info", zenoh.handlers.RingChannel(1), timeout=5.0)
    publisher.put(STOP, 0.0)
    wait_for(lambda: reader.newest() is not None)
    time.sleep(0.3)
    asked = []
    questions.serve(lambda question: (asked.append(question), question.answer(b"")))
    assert 0 < len(asked) <= QUESTIONS
    with pytest.raises(BusError, match="could not be done"):
        ask_while(client, lambda: questions.serve(fail))
    assert robot.boundary.counts[INFO, "ZeroDivisionError"] >= 1


def fail(question):
    raise ZeroDivisionError


def ask_while(client, serve):
    """Ask, and serve meanwhile."""
    stop = threading.Event()

    def work():
        while not stop.wait(0.005):
            serve()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        client.ask(INFO)
    finally:
        stop.set()
        thread.join()


def test_a_fault_with_one_message_is_counted_and_the_robot_goes_on(monkeypatch):
    with served(real_time_null()) as robot, remote(robot) as client, joined(robot) as other:
        submit = robot.governed.submit

        def fail_once(command):
            if command.epoch == other.epoch:
                raise OverflowError("cannot convert float infinity to integer")
            submit(command)

        monkeypatch.setattr(robot.governed, "submit", fail_once)
        ready(other).put(GO, client.now())
        wait_for(lambda: robot._bus.boundary.counts.get(("cmd_vel", "OverflowError")) == 1)
        wait_for(lambda: client.drive(Command(STOP, client.now())).reason is Reason.OK)
        assert robot.failure is None
