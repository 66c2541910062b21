import os
import struct
import time

import numpy as np
import pytest

from lira.hal.errors import DeviceError
from lira.hal.messages import STOP, Odometry, Twist
from lira.sim_backend.emulators.core2 import Core2Unit, Firmware
from lira.sim_backend.emulators.rosserial import Reader, unpack_string
from lira.sim_backend.emulators.rplidar import RplidarUnit
from lira.sim_backend.emulators.rplidar_models import EXPRESS_MODE, Model
from lira.sim_backend.emulators.wire import Wire

ASK = bytes.fromhex("fffe0000ff0000ff")
TWIST = bytes.fromhex("fffe3000cf6500" + struct.pack("<6d", 0.2, 0, 0, 0, 0, 0.5).hex() + "dc")


def board(**firmware):
    twists = []
    unit = Core2Unit(twists.append, lambda: Odometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), Firmware(**firmware))
    unit.receive(b"", 0.0)
    return unit, twists


def call(unit, command, data, now_s):
    body = struct.pack("<H", unit.config_request_id)
    body += b"".join(struct.pack("<I", len(text)) + text for text in (command, data))
    size = struct.pack("<H", len(body) - 2)
    frame = b"\xff\xfe" + size + bytes([255 - sum(size) % 256]) + body + bytes([255 - sum(body) % 256])
    unit.receive(frame, now_s)


def test_a_board_that_boots_talks_garbage_and_obeys_afterwards_what_came_meanwhile():
    unit, twists = board(boot_s=2.0)
    for _ in range(20):  # 13 fit into its serial port
        unit.receive(TWIST, 1.0)
    unit.receive(ASK, 1.1)
    noise = b"".join(unit.emit(now_s) for now_s in np.arange(0.0, 2.0, 0.002))
    assert noise
    assert set(twists) == {STOP}
    unit.emit(2.1)
    assert twists[-1] == Twist(0.2, 0.5)
    assert not unit.configured
    unit.receive(ASK, 2.2)
    assert unit.configured


def test_a_reset_in_mid_drive_stops_it_and_the_ring_starts_it_again():
    unit, twists = board(boot_s=0.0)
    unit.receive(TWIST, 0.1)
    unit.emit(0.1)
    assert twists[-1] == Twist(0.2, 0.5)
    unit.reset(boot_s=0.5)
    unit.receive(TWIST, 0.2)
    unit.emit(0.3)
    assert twists[-1] == STOP
    unit.emit(0.71)
    assert twists[-1] == Twist(0.2, 0.5)


def announcements(unit, now_s=0.0):
    unit.receive(ASK, now_s)
    frames = Reader().read(unit.emit(now_s), now_s)
    told = [(kind, *struct.unpack_from("<H", body), unpack_string(body[2:])[0]) for kind, body in frames if kind < 4]
    return told, [body for kind, body in frames if kind == 7]


def test_ids_and_their_order_are_the_firmwares():
    told, logs = announcements(board(boot_s=0.0)[0])
    assert told[0] == (2, 125, "config")
    assert (0, 127, "pose") in told
    assert (0, 133, "joint_states") in told
    assert told[-3:] == [(3, 100, "config"), (1, 101, "cmd_vel"), (1, 102, "cmd_ser")]
    assert len(logs[-1]) == 391


def test_a_board_that_has_booted_logs_before_anybody_has_asked():
    unit, _ = board(boot_s=0.0)
    assert [topic for topic, _ in Reader().read(unit.emit(0.1), 0.1)] == [7]


@pytest.mark.parametrize(
    ("word", "data", "result", "answer"),
    [
        ("GKIN", "", 0, "DIFF"),
        ("RIMU", "", 1, ""),
        ("EWCH", "", 1, ""),
        ("NONE", "", 2, ""),
        ("SLED", "2", 1, ""),
        ("SLED", "2 1", 0, ""),
        ("SKIN", "FOUR", 1, ""),
    ],
)
def test_words_of_config(word, data, result, answer):
    unit, _ = board(boot_s=0.0)
    unit.receive(ASK, 0.0)
    unit.emit(0.0)
    call(unit, word.encode(), data.encode(), 0.0)
    bodies = [body for topic, body in Reader().read(unit.emit(0.0), 0.0) if topic == 125]
    assert [(unpack_string(body)[0], body[-1]) for body in bodies] == [(answer, result)]


def test_given_back_its_motors_it_stands_until_the_next_command():
    unit, twists = board(boot_s=0.0)
    unit.receive(ASK, 0.0)
    for now_s, word in [(0.1, b"0"), (0.2, b"1")]:
        unit.receive(TWIST, now_s)
        call(unit, b"EMOT", word, now_s)
        unit.emit(now_s)
        assert twists[-1] == STOP
    unit.receive(TWIST, 0.3)
    unit.emit(0.3)
    assert twists[-1] == Twist(0.2, 0.5)


def test_buttons_are_told_when_pressed():
    unit, _ = board(boot_s=0.0)
    unit.receive(ASK, 0.0)
    buttons = unit.published["buttons"]
    assert buttons not in [topic for topic, _ in Reader().read(unit.emit(1.0), 1.0)]
    unit.press(2)
    assert (buttons, b"\2") in Reader().read(unit.emit(1.1), 1.1)


def test_a_frame_that_lost_a_byte_takes_the_next_one_with_it_if_that_comes_at_once():
    assert Reader().read(TWIST[:20] + TWIST[21:] + TWIST, 0.0) == []
    reader = Reader()
    reader.read(TWIST[:20] + TWIST[21:], 0.0)
    assert len(reader.read(TWIST, 0.05)) == 1


def test_it_asks_the_time_and_gives_up_without_an_answer():
    unit, _ = board(boot_s=0.0)
    unit.receive(ASK, 0.0)
    assert bytes.fromhex("fffe0800f70a00") in unit.emit(0.0)
    for now_s in np.arange(0.0, 10.9, 0.1):
        unit.emit(now_s)
    assert unit.configured
    unit.emit(11.1)
    assert not unit.configured


def test_its_watchdog_is_on_before_it_is_told():
    unit, twists = board(boot_s=0.0)
    unit.receive(TWIST, 0.0)
    unit.emit(0.9)
    assert twists[-1] == Twist(0.2, 0.5)
    unit.emit(1.1)
    assert twists[-1] == STOP


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
    assert len(unit.emit(0.4)) < 84  # what was on the line
    assert unit.emit(0.6) == b""


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
    class Chatterbox:
        baud = 38400  # a terminal's own speed

        def receive(self, data, now_s):
            """It does not listen."""

        def emit(self, now_s):
            return bytes(1000)

    wire = Wire(tmp_path / "rplidar", Chatterbox())
    reader = os.open(tmp_path / "rplidar", os.O_RDONLY | os.O_NOCTTY)
    until_s = time.monotonic() + 5.0
    while wire.overflowed == 0:
        assert time.monotonic() < until_s
        time.sleep(0.02)
    os.close(reader)
    wire.close()
