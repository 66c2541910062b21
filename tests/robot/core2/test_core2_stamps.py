"""When the base's readings are of, which way mecanum firmware measures, and what the board tells of itself. Pure."""

import math

import pytest

from lira.hal.messages import STOP, Odometry, Twist
from lira.hal.profile import load_profile
from lira.robot.core2.board import ASK_KINEMATICS, Board
from lira.robot.core2.device import Core2
from lira.robot.core2.rosserial import ASK_TOPICS, parse_answer, parse_frames
from lira.robot.core2.stamps import Stamps
from lira.robot.settings import BaseSettings
from lira.sim_backend.emulators.core2 import Core2Unit, Firmware
from lira.sim_backend.emulators.regulators import SPIN_SLIP_M_RAD, Regulators

BASE = load_profile("rosbot2").base
TICK_S = 0.02


def talk(unit, board, seconds, began_s=1000.0, late_s=0.0):
    """Let a board and its host talk. The host's clock is ahead by `began_s`; after 1 s all it hears is late."""
    unit.receive(ASK_TOPICS, 0.0)
    buffer, under_way = b"", []
    for tick in range(round(seconds / TICK_S)):
        now_s = tick * TICK_S
        under_way.append((now_s + (late_s if now_s > 1.0 else 0.0), unit.emit(now_s)))
        while under_way and under_way[0][0] <= now_s:
            buffer += under_way.pop(0)[1]
        parsed = parse_frames(buffer)
        buffer = buffer[parsed.consumed :]
        for frame in parsed.frames:
            board.handle(frame, began_s + now_s)
        unit.receive(board.calls(began_s + now_s), now_s)


@pytest.mark.parametrize("kinematics", ["DIFF", "MEC"])
def test_the_velocity_is_right_with_either_firmware_whichever_way_the_robot_looks(kinematics):
    unit = Core2Unit(
        lambda _: None, lambda: Odometry(0.0, 1.0, 2.0, 2.07, 0.205, 0.1), Firmware(boot_s=0.0, kinematics=kinematics)
    )
    board = Board(BaseSettings(spin_slip_m_rad=0.0))
    board.configure("EWCH", "1")
    board.configure(ASK_KINEMATICS)
    talk(unit, board, 1.0)
    assert board.kinematics == kinematics
    assert board.readings.odom.linear_m_s == pytest.approx(0.205)
    assert board.readings.odom.angular_rad_s == pytest.approx(0.1)
    assert board.banner.startswith("rosbot firmware 0.16.2")


def test_firmware_that_has_no_word_for_it_is_differential(monkeypatch):
    monkeypatch.setattr("lira.sim_backend.emulators.core2.NUMBERS", {"EWCH": 1})
    board = Board(BaseSettings())
    board.configure(ASK_KINEMATICS)
    talk(Core2Unit(lambda _: None, lambda: Odometry(*[0.0] * 6), Firmware(boot_s=0.0)), board, 0.5)
    assert board.kinematics == "DIFF"


def test_the_answer_to_another_call_says_nothing_of_the_kinematics():
    board = Board(BaseSettings())
    board._hear_answer(b"\x04\0\0\0DIFF\0")
    board._hear_answer(b"\xff\xff\xff\xff")
    assert (board.kinematics, board.unreadable) == (None, 1)


@pytest.mark.parametrize("payload", [b"", b"\0\0\0\0", b"\x05\0\0\0abc\0", b"\xff\xff\xff\xff\0"])
def test_what_is_no_answer_is_refused(payload):
    with pytest.raises(ValueError, match="no answer"):
        parse_answer(payload)


def test_a_late_reading_keeps_its_stamp():
    board = Board(BaseSettings())
    talk(Core2Unit(lambda _: None, lambda: Odometry(*[0.0] * 6), Firmware(boot_s=0.0)), board, 2.4, late_s=0.6)
    assert 1002.4 - board.readings.odom.stamp_s == pytest.approx(0.6, abs=0.1)


def test_stamps_are_believed_from_a_board_whose_clock_is_set_and_from_no_other():
    stamps = Stamps()
    assert stamps.of("pose", 3.0, 100.0) == 100.0  # it was told nothing
    stamps.told(100.0)
    assert stamps.of("pose", 5.0, 100.1) == 100.1  # and has not heard it
    assert stamps.of("pose", 100.2, 101.5) == 100.2
    assert stamps.of("pose", 101.6, 101.55) == 101.55  # nothing is of later than now
    assert stamps.of("pose", 9999.0, 101.6) == 101.6
    stamps.forget()
    assert stamps.of("pose", 101.0, 102.0) == 102.0


def test_no_topics_stamps_run_back():
    stamps = Stamps()
    assert stamps.of("imu", 0.0, 100.0) == 100.0
    stamps.told(100.0)
    assert [stamps.of("imu", said_s, 100.2) for said_s in (99.95, 100.1, 100.05)] == [100.0, 100.1, 100.1]
    assert stamps.of("pose", 99.98, 100.2) == 99.98


def settle(target, seconds=1.0):
    """Speeds of the wheels, left and right, after they have had time to reach a target."""
    regulators, speeds = Regulators(BASE), []
    for tick in range(round(seconds / 0.01)):
        twist = regulators.drive(target, tick * 0.01)
        half = twist.angular_rad_s * BASE.track_m / 2
        speeds.append((twist.linear_m_s - half, twist.linear_m_s + half))
    tail = speeds[-40:]
    return [sum(side) / len(tail) for side in zip(*tail, strict=True)], speeds


@pytest.mark.parametrize(
    ("target", "left", "right"),
    [
        (Twist(0.2, 0.0), 0.2025, 0.2025),
        (Twist(0.1, 0.0), 0.0975, 0.0975),
        (Twist(0.02, 0.0), 0.0225, 0.0225),
        (Twist(0.0, 0.8), -0.0825, 0.0825),
        (Twist(0.2, 0.8), 0.1125, 0.2925),
        (STOP, 0.0, 0.0),
    ],
)
def test_the_wheels_swing_about_what_they_are_to_do_as_the_firmwares_do(target, left, right):
    means, speeds = settle(target)
    assert means == [pytest.approx(left), pytest.approx(right)]
    assert max(speed for _, speed in speeds) <= right + 0.0076


def test_a_turn_on_the_spot_is_reckoned_as_a_little_motion_back_and_the_driver_takes_it_out():
    regulators = Regulators(BASE)
    for step in range(101):
        seen = regulators.reckon(Odometry(0.0, 0.0, 0.0, math.remainder(step * 0.1, math.tau), 0.0, 0.5))
    assert seen.linear_m_s == pytest.approx(SPIN_SLIP_M_RAD * 0.5)
    assert math.hypot(seen.x_m, seen.y_m) == pytest.approx(abs(2 * SPIN_SLIP_M_RAD * math.sin(10.0 / 2)), rel=0.01)
    assert BaseSettings().spin_slip_m_rad == SPIN_SLIP_M_RAD


def test_a_base_that_was_never_open_tells_of_itself():
    told = Core2("/dev/null", BaseSettings(), 0.3).diagnostics()
    assert told.name == "base"
    assert dict(told.values)["negotiations"] == "0"
