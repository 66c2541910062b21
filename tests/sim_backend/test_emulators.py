import os
import struct
import time

import numpy as np
import pytest

from hal.errors import DeviceError
from hal.messages import STOP, Odometry, Twist
from sim_backend.emulators.core2 import Core2Unit, Firmware
from sim_backend.emulators.rplidar import EXPRESS_MODE, Model, RplidarUnit
from sim_backend.emulators.wire import Wire

ASK = bytes.fromhex("fffe0000ff0000ff")
TWIST = bytes.fromhex("fffe3000cf6500" + struct.pack("<6d", 0.2, 0, 0, 0, 0, 0.5).hex() + "dc")


def board(**firmware):
    twists = []
    unit = Core2Unit(twists.append, lambda: Odometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), Firmware(**firmware))
    unit.receive(b"", 0.0)
    return unit, twists


def call(unit, command, data, now_s):
    body = struct.pack("<H", unit.config_id)
    body += b"".join(struct.pack("<I", len(text)) + text for text in (command, data))
    size = struct.pack("<H", len(body) - 2)
    frame = b"\xff\xfe" + size + bytes([255 - sum(size) % 256]) + body + bytes([255 - sum(body) % 256])
    unit.receive(frame, now_s)


def test_a_board_that_boots_hears_nothing_and_talks_garbage():
    unit, _ = board(boot_s=2.0)
    unit.receive(ASK, 1.0)
    noise = b"".join(unit.emit(now_s) for now_s in np.arange(0.0, 2.0, 0.002))
    assert noise
    assert not unit.configured
    unit.receive(ASK, 2.1)
    assert unit.configured


def test_it_asks_the_time_and_gives_up_without_an_answer():
    unit, _ = board(boot_s=0.0)
    unit.receive(ASK, 0.0)
    assert unit.emit(0.0).startswith(bytes.fromhex("fffe0800f70a00"))
    for now_s in np.arange(0.0, 10.9, 0.1):
        unit.emit(now_s)
    assert unit.configured
    unit.emit(11.1)
    assert not unit.configured


@pytest.mark.parametrize("watchdog", [True, False])
def test_the_watchdog_stops_after_a_second_if_it_is_on(watchdog):
    unit, twists = board(boot_s=0.0)
    unit.receive(ASK, 0.0)
    call(unit, b"EWCH", b"1" if watchdog else b"0", 0.1)
    unit.receive(TWIST, 1.0)
    unit.emit(1.9)
    assert twists[-1] == Twist(0.2, 0.5)
    unit.emit(2.1)
    assert twists[-1] == (STOP if watchdog else Twist(0.2, 0.5))


def test_a_slow_or_corrupt_frame_is_not_obeyed():
    unit, twists = board(boot_s=0.0)
    unit.receive(ASK, 0.0)
    unit.receive(TWIST[:30], 1.0)
    unit.receive(TWIST[30:], 1.05)
    unit.receive(TWIST[:-1] + b"\0", 2.0)
    unit.emit(2.0)
    assert set(twists) <= {STOP}
    unit.receive(TWIST[:30], 3.0)
    unit.receive(TWIST[30:], 3.01)
    unit.emit(3.01)
    assert twists[-1] == Twist(0.2, 0.5)


def test_a_lidar_streams_only_while_its_head_turns():
    unit = RplidarUnit(lambda theta: 1.0 + 0.0 * theta, Model(modes=(EXPRESS_MODE,)))
    unit.receive(bytes.fromhex("a582050000000000" + "22"), 0.0)
    assert len(unit.emit(0.1)) == 7  # the head of the answer
    unit.receive(bytes.fromhex("a5f0029402c1"), 0.1)
    assert len(unit.emit(0.2)) >= 84 * 10
    unit.receive(bytes.fromhex("a525"), 0.2)
    assert unit.emit(0.4) == b""


def test_a_request_with_a_wrong_check_is_ignored():
    unit = RplidarUnit(lambda theta: theta)
    unit.receive(bytes.fromhex("a5f0029402c0"), 0.0)
    assert unit.pwm == 0


def test_a_wire_does_not_take_the_place_of_a_file(tmp_path):
    (tmp_path / "rplidar").write_text("mine")
    with pytest.raises(DeviceError, match="cannot make"):
        Wire(tmp_path / "rplidar", RplidarUnit(lambda theta: theta))
    assert (tmp_path / "rplidar").read_text() == "mine"


def test_bytes_that_nobody_fetches_are_lost_and_counted(tmp_path):
    unit = RplidarUnit(lambda theta: 1.0 + 0.0 * theta)
    unit.pwm, unit.mode = 660, EXPRESS_MODE
    unit.baud = 38400  # a terminal's own speed
    wire = Wire(tmp_path / "rplidar", unit)
    reader = os.open(tmp_path / "rplidar", os.O_RDONLY | os.O_NOCTTY)
    until_s = time.monotonic() + 5.0
    while wire.overflowed == 0:
        assert time.monotonic() < until_s
        time.sleep(0.02)
    os.close(reader)
    wire.close()
