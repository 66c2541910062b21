"""Law 1 end to end: the twin in one process, a driver in another, and what the wheels do when the driver dies."""

import signal
import time
import uuid

import pytest

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED, OPERATOR, SIM_STATE
from lira.hal.messages import HELD, STOP, OperatorRequest, Reason, Request
from lira.hal.messages.ros.codec import encode
from lira.hal.profile import STOP_BUDGET_S
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

READY_S = 60.0
TIMEOUT_S = 30.0
SLACK_S = 0.05  # the wheels are looked at 20 times a second


class Witness:
    """Hears from the bus what the wheels get and where the robot is, all of it in order."""

    def __init__(self, bus):
        self._bus = bus
        self._applied, self._states = bus.reader(APPLIED, depth=256), bus.reader(SIM_STATE, depth=256)
        self.applied, self.states = [], []

    def look(self):
        self.applied += [received.message for received in self._applied.poll()]
        self.states += [received.message for received in self._states.poll()]

    def watch(self, seconds):
        """Return what happened in that time only."""
        self.look()
        applied, states = len(self.applied), len(self.states)
        deadline_s = time.monotonic() + seconds
        while time.monotonic() < deadline_s:
            time.sleep(0.05)
            self.look()
        return self.applied[applied:], self.states[states:]

    def wait(self, condition, timeout_s):
        deadline_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline_s, f"never happened; applied {self.applied[-3:]}"
            time.sleep(0.02)
            self.look()

    def drive_on(self, metres):
        """Return what happened until the robot was that much further along the line.

        A driver that paused, as on a busy machine, is held until a person lets it go on.
        """
        self.look()
        count, asked_s = len(self.states), time.monotonic()

        def further():
            nonlocal asked_s
            if self.applied and self.applied[-1].reason in HELD and time.monotonic() > asked_s + 1.0:
                self._bus.put_raw(OPERATOR, encode(OperatorRequest(Request.RESUME)))
                asked_s = time.monotonic()
            states = self.states[count:]
            return bool(states) and self.moves and states[-1].progress_m > states[0].progress_m + metres

        self.wait(further, TIMEOUT_S)
        return self.states[count:]

    @property
    def moves(self):
        return bool(self.states) and self.states[-1].linear_m_s > 0.5


@pytest.fixture
def address():
    return f"e2e_{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}"


@pytest.fixture
def twin(address, tmp_path):
    command = lira_command("twin", "--world", "line", "--name", address[0], "--listen", address[1])
    with ChildProcess("the twin", command, tmp_path / "twin.log") as process:
        process.wait_ready("serves world", READY_S)
        yield process


@pytest.fixture
def witness(address, twin):
    bus = Bus(address[0], connect=address[1])
    yield Witness(bus)
    assert bus.close()


def fusion(address, log):
    command = lira_command("drive", "camera-expert", "--name", address[0], "--connect", address[1])
    return ChildProcess("the driver", command, log)


def test_the_camera_expert_drives_the_line_and_a_killed_driver_stops_the_wheels_in_time(
    address, twin, witness, tmp_path
):
    with fusion(address, tmp_path / "first.log") as driver:
        driver.wait_ready("drives", READY_S)
        states = witness.drive_on(6.0)
        assert max(abs(state.lateral_m) for state in states) < 0.5
        assert not states[-1].collided
        assert not states[-1].lost
        driver.signal(signal.SIGKILL)
        witness.wait(lambda: witness.applied[-1].twist == STOP, 5.0)

    moving = [applied for applied in witness.applied if applied.twist != STOP]
    still = next(applied for applied in witness.applied if applied.stamp_s > moving[-1].stamp_s)
    last_command_s = max(applied.stamp_s - applied.command_age_s for applied in moving)
    assert still.reason is Reason.STALE
    assert still.stamp_s - last_command_s <= STOP_BUDGET_S + SLACK_S

    applied, states = witness.watch(1.0)
    assert {each.twist for each in applied} == {STOP}
    assert len({(state.x_m, state.y_m, state.yaw_rad) for state in states}) == 1
    last_move = [state for state in witness.states if state.linear_m_s != 0.0][-1]
    assert last_move.stamp_s - last_command_s <= STOP_BUDGET_S + SLACK_S

    with fusion(address, tmp_path / "second.log") as driver:
        driver.wait_ready("drives", READY_S)
        states = witness.drive_on(1.0)
        assert states[-1].progress_m > last_move.progress_m + 0.5
        assert max(abs(state.lateral_m) for state in states) < 0.5
        driver.signal(signal.SIGINT)
        assert driver.wait(20.0) == 0
        assert "Traceback" not in driver.output()
    witness.wait(lambda: witness.applied[-1].twist == STOP, 5.0)
    assert twin.status() is None
