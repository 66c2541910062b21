"""Whatever stops the driver's process, the board is told to stand long before its own watchdog would strike."""

import signal
import subprocess
import sys
import time

import pytest

from lira.hal.errors import DeviceError
from lira.hal.messages import STOP, Odometry, Twist
from lira.robot.core2.device import Core2
from lira.robot.core2.watchdog import WatchdogProcess
from lira.robot.settings import BaseSettings
from lira.robot.supervisor import Supervisor
from lira.sim_backend.emulators.core2 import WATCHDOG_S, Core2Unit, Firmware
from lira.sim_backend.emulators.wire import Wire

GO = Twist(0.2, 0.0)
SOON_S = 0.35
DRIVER = """
import sys, time
from lira.hal.messages import Twist
from lira.robot.core2.device import Core2
from lira.robot.supervisor import Supervisor
from lira.robot.settings import BaseSettings
base = Core2(sys.argv[1], BaseSettings(boot_s=0.15), 0.3)
supervisor = Supervisor("base", base.session)
supervisor.start()
while True:
    base.drive(Twist(0.2, 0.0))
    time.sleep(0.02)
"""


class Board:
    """A board on a wire, and when its wheels were last given what."""

    def __init__(self, path):
        self.given = [(0.0, STOP)]
        self.unit = Core2Unit(self.drive, lambda: Odometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), Firmware(boot_s=0.1))
        self.wire = Wire(path, self.unit)

    def drive(self, twist):
        if twist != self.given[-1][1]:
            self.given.append((time.monotonic(), twist))

    def wait_for(self, twist, timeout_s=8.0):
        until_s = time.monotonic() + timeout_s
        while self.given[-1][1] != twist:
            assert time.monotonic() < until_s, self.given
            time.sleep(0.005)
        return self.given[-1][0]


@pytest.fixture
def board(tmp_path):
    board = Board(tmp_path / "core2")
    yield board
    board.wire.close()


@pytest.fixture
def driver(board, tmp_path):
    process = subprocess.Popen([sys.executable, "-c", DRIVER, str(tmp_path / "core2")])
    try:
        board.wait_for(GO)
        time.sleep(0.3)
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_driver_that_is_killed_or_frozen_stops_at_once(board, driver, number):
    assert SOON_S < WATCHDOG_S / 2
    driver.send_signal(number)
    struck_s = time.monotonic()
    assert board.wait_for(STOP) - struck_s < SOON_S
    assert not board.unit.crashed


def test_a_guard_that_has_struck_writes_nothing_to_a_board_that_has_begun_anew(board, driver):
    driver.send_signal(signal.SIGSTOP)
    board.wait_for(STOP)
    time.sleep(0.6)  # its zeros are out
    board.unit.reset(0.1)
    time.sleep(0.4)
    driver.kill()
    time.sleep(0.3)
    assert board.unit.obeyed_unannounced == 0
    assert board.given[-1][1] == STOP


def test_the_guard_ends_with_its_driver(board, driver):
    guards = children(driver.pid)
    assert len(guards) == 1
    driver.kill()
    board.wait_for(STOP)
    until_s = time.monotonic() + 3.0
    while any(is_alive(pid) for pid in guards):
        assert time.monotonic() < until_s
        time.sleep(0.02)


def children(pid):
    listed = subprocess.run(["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=True)
    return [int(word) for word in listed.stdout.split()]


def is_alive(pid):
    listed = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True, check=False)
    return bool(listed.stdout.strip()) and not listed.stdout.startswith("Z")


def test_who_was_thawed_counts_a_loss_and_stands_for_a_moment(board, tmp_path, monkeypatch):
    for page in ("contact", "device"):  # on a busy machine the emulated board is silent now and then
        monkeypatch.setattr(f"lira.robot.core2.{page}.SILENCE_S", 5.0)
    base = Core2(str(tmp_path / "core2"), BaseSettings(boot_s=0.15), 5.0)
    supervisor = Supervisor("base", base.session)
    supervisor.start()
    try:
        supervisor.wait_alive(8.0)
        base.drive(GO)
        board.wait_for(GO)
        time.sleep(0.3)  # given power at the start, the motors stand until the next command
        board.wait_for(GO)
        losses, guard = base.losses, base._guard
        told, guard.tell = guard.tell, lambda: False  # alive, but it says nothing
        stood_s = board.wait_for(STOP, 3.0)
        guard.tell = told
        until_s = time.monotonic() + 3.0
        while base.losses == losses:
            assert time.monotonic() < until_s
            time.sleep(0.005)
        assert board.wait_for(GO, 4.0) - stood_s > 0.05
    finally:
        supervisor.close()


def test_nobody_drives_without_a_guard(tmp_path):
    with (tmp_path / "line").open("wb") as line:
        guard = WatchdogProcess(line.fileno(), b"\x01")
        assert guard.tell() is False
        guard._process.kill()
        guard._process.wait()
        with pytest.raises(DeviceError, match="guard"):
            guard.tell()
        guard.close()
