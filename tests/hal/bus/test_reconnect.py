"""A bus whose link breaks and comes back, with the link in a process of its own."""

import gc
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import pytest
from wiring import new_endpoint, new_name, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.connection import Connection
from lira.hal.bus.topics import APPLIED, CMD_VEL, ESTOP, INFO
from lira.hal.bus.zenoh_session import open_session
from lira.hal.errors import BusError
from lira.hal.messages import STOP, Applied, Bool, Twist
from lira.tools.launch import link_fault as relay

AWAY_S = 0.5  # less than a lease: the robot still holds the link that broke


@contextmanager
def relayed(front, behind):
    """A relay between two endpoints, killed at the end."""
    words = [sys.executable, "-m", relay.__name__, front.rpartition(":")[2], behind.rpartition(":")[2]]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert relay.READY in process.stdout.readline()
        try:
            yield
        finally:
            process.kill()


def hears(publisher, message, reader):
    """Whether what one end puts now comes to the other."""
    reader.poll()

    def came():
        publisher.put(message, time.monotonic())
        return bool(reader.poll())

    wait_for(came)
    return True


@pytest.mark.parametrize("watch", [False, True])
def test_whatever_breaks_the_link_both_ends_hear_each_other_afterwards(watch):
    name, front, behind = new_name(), new_endpoint(), new_endpoint()
    robot = Bus(name, listen=behind)
    applied, commands = robot.publisher(APPLIED), robot.reader(CMD_VEL)
    asked = robot.questions(INFO)
    with relayed(front, behind):
        client = Bus(name, connect=front, watch=watch)
        results, command = client.reader(APPLIED), client.publisher(CMD_VEL)
        assert hears(applied, Applied(STOP, 0.0), results)
        assert hears(command, Twist(0.1, 0.0), commands)
        epoch = client.epoch
    for _ in range(3):
        time.sleep(AWAY_S)
        with relayed(front, behind):
            assert hears(applied, Applied(STOP, 0.0), results)
            assert hears(command, Twist(0.1, 0.0), commands)
            assert commands.newest().attachment.epoch == epoch
            assert is_answered(client, asked)
    assert client.close()
    assert robot.close()
    with pytest.raises(BusError):
        command.put(Twist(0.1, 0.0), 0.0)


def is_answered(client, asked):
    """Whether the robot gets a question of the client's, and the client the answer."""
    answers = []
    asking = threading.Thread(target=lambda: answers.append(client.ask(INFO)))
    asking.start()
    wait_for(lambda: asked.serve(lambda question: question.answer(b"yes")) or not asking.is_alive())
    asking.join()
    return answers == [b"yes"]


def test_what_nobody_uses_any_more_is_not_declared_again():
    name, front, behind = new_name(), new_endpoint(), new_endpoint()
    robot = Bus(name, listen=behind)
    commands = robot.publisher(CMD_VEL)
    with relayed(front, behind):
        client = Bus(name, connect=front)
        reader, used = client.reader(CMD_VEL), client.reader(APPLIED)
        wait_for(lambda: commands.matching)
    del reader
    gc.collect()
    with relayed(front, behind):
        assert hears(robot.publisher(APPLIED), Applied(STOP, 0.0), used)
        wait_for(lambda: not commands.matching)
    assert client.close()
    assert robot.close()


def test_what_is_latched_stays_so_on_the_next_link():
    name, front, behind = new_name(), new_endpoint(), new_endpoint()
    robot = Bus(name, listen=behind)
    with relayed(front, behind):
        client = Bus(name, connect=front)
        button = client.publisher(ESTOP)  # kept: what nobody holds any more is not declared again
        button.put(Bool(True), time_s=1.0)
        wait_for(lambda: robot.peers() == 1)
    with relayed(front, behind):
        wait_for(lambda: client.links() == 2)
        late = robot.reader(ESTOP)
        wait_for(lambda: late.newest() is not None)
        assert late.newest().message == Bool(True)
    assert client.close()
    assert robot.close()


def test_however_many_datagrams_are_lost_at_the_beginning_both_ends_hear_each_other_afterwards():
    name, front, behind = new_name(), new_endpoint(), new_endpoint()
    robot = Bus(name, listen=behind)
    applied, commands = robot.publisher(APPLIED), robot.reader(CMD_VEL)
    ports = [int(endpoint.rpartition(":")[2]) for endpoint in (front, behind)]
    with relay.Relay(*ports) as between:
        clients = []
        for _ in range(20):
            between.faults.lost = 0.4
            clients.append(client := Bus(name, connect=front))
            results, command = client.reader(APPLIED), client.publisher(CMD_VEL)
            time.sleep(0.05)
            between.faults.lost = 0.0
            assert hears(applied, Applied(STOP, 0.0), results)
            assert hears(command, Twist(0.1, 0.0), commands)
        for session in (*clients, robot):
            session.close(0.0)  # some still wait for their datagrams


def test_datagrams_that_do_not_get_through_at_first_do_so_later():
    name, front, behind = new_name(), new_endpoint(), new_endpoint()
    robot = Bus(name, listen=behind)
    ports = [int(endpoint.rpartition(":")[2]) for endpoint in (front, behind)]
    with relay.Relay(*ports) as between:
        between.faults.lost = 1.0
        client = Bus(name, connect=front)
        assert client.links() == 1
        assert hears(robot.publisher(APPLIED), Applied(STOP, 0.0), client.reader(APPLIED))
        between.faults.lost = 0.0
        wait_for(lambda: client.links() == robot.links() == 2)
    assert client.close()
    assert robot.close()


def test_whoever_connects_too_early_keeps_trying():
    name, endpoint = new_name(), new_endpoint()
    client = Bus(name, connect=endpoint)
    results = client.reader(APPLIED)
    time.sleep(AWAY_S)
    robot = Bus(name, listen=endpoint)
    assert hears(robot.publisher(APPLIED), Applied(STOP, 0.0), results)
    assert client.close()
    assert robot.close()


def test_a_session_that_is_closed_is_replaced():
    name, endpoint = new_name(), new_endpoint()
    robot = Bus(name, listen=endpoint)

    def session(connect=None):
        return open_session(name, None, connect, None)

    connection = Connection(session, lambda: session(endpoint))
    assert connection.wait_up(5.0)
    first = connection.session
    first.close()
    wait_for(lambda: connection.session is not first and robot.peers() == 1)
    assert connection.close(5.0)
    assert robot.close()
