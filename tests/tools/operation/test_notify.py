"""The line to a supervisor, against a socket that listens as systemd does."""

import os
import socket
import threading

import pytest

from lira.hal.profile import load_profile
from lira.hal.server.serve import serve
from lira.hal.testing import NullRobot
from lira.tools.launch.notify import Notifier
from lira.tools.launch.processes import free_port


@pytest.fixture
def ear(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(10.0)
        yield listening


def heard(ear):
    ear.setblocking(False)
    said = []
    try:
        while True:
            said.append(ear.recv(4096).decode())
    except BlockingIOError:
        return said


def test_ready_comes_with_one_line_of_status(ear, tmp_path):
    notifier = Notifier(str(tmp_path / "notify"))
    notifier.ready("twin serves\nand more")
    notifier.ready()
    assert heard(ear) == ["READY=1\nSTATUS=twin serves", "READY=1"]


def test_a_sign_of_life_is_sent_three_times_within_the_patience_however_often_the_loop_turns(ear, tmp_path):
    times = [0.0]
    notifier = Notifier(str(tmp_path / "notify"), 3.0, lambda: times[0])
    for hundredth in range(300):
        times[0] = hundredth / 100
        notifier.alive()
    assert heard(ear) == ["WATCHDOG=1"] * 3


def test_who_is_not_watched_sends_no_sign_of_life(ear, tmp_path):
    Notifier(str(tmp_path / "notify")).alive()
    assert heard(ear) == []


def test_the_environment_says_where_and_how_often_and_keeps_nothing_for_children(ear, tmp_path):
    environ = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "2000000", "WATCHDOG_PID": str(os.getpid())}
    notifier = Notifier.from_environment(environ)
    notifier.alive()
    assert heard(ear) == ["WATCHDOG=1"]
    assert environ == {}


def test_a_watchdog_that_is_meant_for_another_process_is_not_fed(ear, tmp_path):
    environ = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "2000000", "WATCHDOG_PID": "1"}
    Notifier.from_environment(environ).alive()
    assert heard(ear) == []


def test_a_supervisor_that_is_gone_or_does_not_read_holds_nobody_up(tmp_path):
    Notifier(str(tmp_path / "nobody"), 1.0).ready("it goes on")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as deaf:
        deaf.bind(str(tmp_path / "deaf"))
        notifier = Notifier(str(tmp_path / "deaf"), 1e-9)
        for _ in range(2000):
            notifier.alive()


def test_an_abstract_socket_as_systemd_may_have_it():
    name = f"lira-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind(f"\0{name}")
        Notifier(f"@{name}").ready()
        assert heard(ear) == ["READY=1"]


def test_a_robot_on_the_bus_lives_by_the_loop_that_moves_its_wheels():
    threads, stop = set(), threading.Event()

    def alive():
        threads.add(threading.current_thread().name)
        stop.set()

    endpoint = f"127.0.0.1:{free_port()}"
    serve(NullRobot(load_profile("thesis-sim")), f"notify_{os.getpid()}", endpoint, alive=alive, stop=stop)
    assert threads == {"hal-commands"}
