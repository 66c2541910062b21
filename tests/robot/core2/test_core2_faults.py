"""What a board or a line that fails in mid drive makes the wheels do, measured as metres on the floor."""

import time

import pytest

from lira.hal.messages import STOP, Command, Odometry, Twist
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.robot.rosbot import Devices, Rosbot
from lira.robot.settings import BaseSettings, Settings
from lira.sim_backend.emulators.core2 import WATCHDOG_S, Core2Unit, Firmware
from lira.sim_backend.emulators.wire import Wire

pytestmark = pytest.mark.slow

GO = Twist(0.2, 0.0)
RAMP_M_S2 = 1.5
BRAKING_M = GO.linear_m_s**2 / (2 * RAMP_M_S2)


class Wheels:
    """Wheels with the firmware's ramp."""

    def __init__(self):
        self.speed_m_s = self.target_m_s = self.travel_m = 0.0
        self.changed_s = time.monotonic()
        self.stood_s = self.changed_s

    def drive(self, twist):
        """Move on to now, and take a new target."""
        now_s = time.monotonic()
        step_s = 0.001
        while self.changed_s < now_s:
            reach = RAMP_M_S2 * step_s
            self.speed_m_s += max(-reach, min(reach, self.target_m_s - self.speed_m_s))
            self.travel_m += abs(self.speed_m_s) * step_s
            self.changed_s += step_s
            if self.speed_m_s:
                self.stood_s = self.changed_s
        self.target_m_s = twist.linear_m_s

    def measure(self):
        self.drive(Twist(self.target_m_s, 0.0))
        return Odometry(0.0, self.travel_m, 0.0, 0.0, self.speed_m_s, 0.0)


class Rig:
    """A robot of a base alone under its governor, driven by somebody who never lets go."""

    def __init__(self, path):
        self.wheels = Wheels()
        self.unit = Core2Unit(self.wheels.drive, self.wheels.measure, Firmware(boot_s=0.05))
        self.wire = Wire(path, self.unit)
        settings = Settings(base=BaseSettings(boot_s=0.1))
        self.rosbot = Rosbot(load_profile("thesis-sim"), Devices(str(path), settings=settings))
        self.robot = GovernedRobot(self.rosbot)

    def keep(self, twist, seconds):
        """Command for a while; returns the longest pause that this hand made, as it does on a busy machine."""
        longest_s, at_s = 0.0, time.monotonic()
        until_s = at_s + seconds
        while at_s < until_s:
            self.robot.read()
            self.robot.drive(Command(twist, self.robot.now()))
            time.sleep(0.02)
            before_s, at_s = at_s, time.monotonic()
            longest_s = max(longest_s, at_s - before_s)
        return longest_s

    def keep_until(self, condition, timeout_s=20.0):
        """Command on until it is so; a busy machine takes its time."""
        until_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < until_s
            self.keep(GO, 0.1)

    def get_going(self):
        """Drive, after a neutral command; on a busy machine the board may be missed, and has to have another one."""
        for _ in range(5):
            self.keep(STOP, 0.3)
            self.keep(GO, 0.5)
            if self.wheels.speed_m_s > 0.15:
                return
        pytest.fail("it does not get going")


@pytest.fixture
def rig(tmp_path):
    rig = Rig(tmp_path / "core2")
    rig.robot.open()
    yield rig
    rig.robot.close()
    rig.wire.close()


@pytest.mark.parametrize("boot_s", [0.3, 0.6, 1.1, 2.0, 4.0])
def test_a_board_that_resets_in_mid_drive_turns_no_wheel_unasked(rig, boot_s):
    for _ in range(5):
        rig.get_going()
        losses = rig.rosbot.base.losses
        before_m = rig.wheels.travel_m
        rig.unit.reset(boot_s)
        paused_s = rig.keep(GO, boot_s + 1.5)
        assert rig.wheels.travel_m - before_m < BRAKING_M + 0.01
        if rig.rosbot.base.losses > losses or paused_s < 0.1:  # who did not look meanwhile has missed nothing
            break
    assert rig.rosbot.base.losses > losses
    rig.keep_until(lambda: rig.rosbot.base.answers)
    if boot_s > 0.45:  # until then it may only be the silence of a bad line, which gets zeros
        assert rig.unit.obeyed_unannounced == 0
    assert not rig.unit.crashed
    rig.get_going()


def test_a_board_that_resets_at_the_fastest_commands_has_room_for_zeros_in_its_ring(rig):
    rig.get_going()
    rig.unit.reset(0.6)
    before_m = rig.wheels.travel_m
    count = 0
    while rig.rosbot.base.answers:
        count += 1
        rig.rosbot.base.drive(Twist(0.2 + count * 1e-6, 0.0))
        time.sleep(0.002)
    rig.keep(GO, 2.0)
    assert rig.wheels.travel_m - before_m < BRAKING_M + 0.01


def test_a_board_that_is_heard_no_more_stands_soon(rig):
    rig.get_going()
    rig.wire.mute = True
    cut_s = time.monotonic()
    rig.keep(GO, 1.5)
    assert rig.wheels.speed_m_s == 0.0
    assert rig.wheels.stood_s - cut_s < 0.7
    before_m = rig.wheels.travel_m
    rig.wire.mute = False
    rig.keep(GO, 2.0)
    assert rig.wheels.travel_m == before_m
    rig.get_going()


def test_a_board_that_hears_no_more_is_stopped_by_its_own_watchdog(rig):
    rig.get_going()
    rig.wire.deaf = True
    cut_s = time.monotonic()
    rig.keep(GO, 2.0)
    assert rig.wheels.speed_m_s == 0.0
    assert WATCHDOG_S < rig.wheels.stood_s - cut_s < WATCHDOG_S + 0.35
    before_m = rig.wheels.travel_m
    rig.wire.deaf = False
    rig.keep(GO, 2.0)
    assert rig.wheels.travel_m == before_m
    rig.get_going()


def test_a_hiccup_of_the_line_is_a_loss_too(rig):
    rig.get_going()
    losses = rig.rosbot.base.losses
    rig.wire.mute = True
    rig.keep(GO, 0.28)
    rig.wire.mute = False
    rig.keep(GO, 0.3)
    before_m = rig.wheels.travel_m
    rig.keep(GO, 0.5)
    assert rig.rosbot.base.losses > losses
    assert rig.wheels.travel_m == before_m


def test_a_line_that_loses_a_byte_now_and_then_drives_on(rig):
    rig.get_going()
    rig.wire.loss = 0.005
    rig.keep(GO, 2.0)
    rig.get_going()
    assert rig.rosbot.base.counts.lost_bytes > 0
    assert not rig.unit.crashed
