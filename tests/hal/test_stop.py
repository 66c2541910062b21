"""Law 1 with real processes: kill the driver, and the wheels stand within the budget; so when the server ends."""

import signal
import subprocess
import sys

import pytest
from wiring import new_endpoint, new_name, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED
from lira.hal.client.connect import open_remote
from lira.hal.messages import STOP, Command, Reason, Twist
from lira.hal.profile import STOP_BUDGET_S
from lira.tools.bench.parts import null_robot
from lira.tools.launch.processes import ChildProcess

DRIVER = """
import sys
from lira.hal.bus.bus import Bus
from lira.hal.messages import STOP, Command, Reason, Twist
from lira.hal.client.connect import open_remote
robot = open_remote(Bus(sys.argv[1], connect=sys.argv[2]))
twist = STOP
for _ in range(1000):
    applied = robot.drive(Command(twist, robot.now(), answers=robot.read().seq))
    twist = STOP if applied.reason is Reason.NEUTRAL_FIRST else Twist(0.5, 0.0)  # begins again after a pause
    robot.wait(robot.now() + robot.profile.period_s)
"""


@pytest.fixture
def address():
    return new_name(), new_endpoint()


@pytest.fixture
def server(address, tmp_path):
    command = [sys.executable, "-m", "lira.tools.bench.parts.null_robot", *address]
    with ChildProcess("the robot", command, tmp_path / "lira.robot.log") as process:
        process.wait_ready(null_robot.READY, 30.0)
        yield process


@pytest.fixture
def bus(address, server):
    bus = Bus(address[0], connect=address[1])
    yield bus
    assert bus.close()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_driver_that_dies_stops_the_wheels_in_time(address, bus, number):
    reader = bus.reader(APPLIED, depth=256)
    driver = subprocess.Popen([sys.executable, "-c", DRIVER, *address])
    seen = []

    def last():
        seen.extend(received.message for received in reader.poll())
        return seen[-1].twist if seen else STOP

    try:
        wait_for(lambda: last() != STOP, 20.0)
        driver.send_signal(number)
        wait_for(lambda: last() == STOP)
    finally:
        driver.kill()
        driver.wait()
    moving = [applied for applied in seen if applied.twist != STOP]
    still = next(applied for applied in seen if applied.stamp_s > moving[-1].stamp_s)
    last_command_s = max(applied.stamp_s - applied.command_age_s for applied in moving)
    assert still.reason is Reason.STALE
    assert still.stamp_s - last_command_s <= STOP_BUDGET_S + 0.05
    # Nothing moves it but a neutral command, and then it goes on.
    robot = open_remote(bus)
    go = Twist(0.25, 0.0)
    wait_for(lambda: robot.drive(Command(go, robot.now())).reason is Reason.NEUTRAL_FIRST)
    wait_for(lambda: robot.drive(Command(STOP, robot.now())).reason is Reason.OK)
    wait_for(lambda: robot.drive(Command(go, robot.now())).twist == go)
    robot.close()


def test_sigterm_stops_the_wheels_and_ends_the_server(address, server, bus):
    robot = open_remote(bus)
    wait_for(lambda: robot.drive(Command(STOP, robot.now())).reason is Reason.OK)
    wait_for(lambda: robot.drive(Command(Twist(0.5, 0.0), robot.now())).twist != STOP)
    server._process.send_signal(signal.SIGTERM)
    assert server.wait(10.0) == 0
    robot.close()


def test_a_second_server_of_the_same_name_is_refused_and_the_first_goes_on(address, server, bus):
    again = [sys.executable, "-m", "lira.tools.bench.parts.null_robot", address[0], new_endpoint()]
    done = subprocess.run(again, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode != 0
    assert "already runs" in done.stderr
    robot = open_remote(bus)
    robot.close()
