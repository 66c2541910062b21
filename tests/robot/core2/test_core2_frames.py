import contextlib
import math
import re
import struct
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lira.hal.errors import SensorError
from lira.hal.messages import Odometry, Twist
from lira.robot.core2 import messages
from lira.robot.core2.board import Board
from lira.robot.core2.rosserial import (
    ASK_TOPICS,
    Frame,
    Id,
    TopicInfo,
    encode_frame,
    encode_strings,
    encode_time,
    parse_frames,
    parse_topic_info,
)
from lira.robot.core2.wheels import Pose, Reckoner
from lira.robot.settings import BaseSettings
from lira.sim_backend.emulators import core2 as emulated
from lira.sim_backend.emulators import rosserial as emulator

FRAMES = [Frame(topic, bytes([topic % 256] * size)) for topic, size in [(100, 0), (125, 48), (10, 8), (127, 320)] * 5]
STREAM = b"".join(encode_frame(frame.topic, frame.payload) for frame in FRAMES)


def feed(pieces):
    buffer, frames, lost = b"", [], 0
    for piece in pieces:
        parsed = parse_frames(buffer + piece)
        buffer = (buffer + piece)[parsed.consumed :]
        frames += parsed.frames
        lost += parsed.lost
    return frames, lost, buffer


def test_frames_are_those_of_the_board():
    assert bytes.fromhex("fffe0000ff0000ff") == ASK_TOPICS
    assert encode_frame(Id.STOP) == bytes.fromhex("fffe0000ff0b00f4")
    frame = encode_frame(101, messages.encode_twist(Twist(0.2, 0.5)))
    assert frame[:7] == bytes.fromhex("fffe3000cf6500")
    assert len(frame) == 7 + 48 + 1
    assert frame[-1] == 0xDC
    assert encode_time(12.5)[5:-1] == struct.pack("<HII", 10, 12, 500_000_000)


def test_a_payload_beyond_the_boards_buffer_is_refused():
    with pytest.raises(ValueError, match="buffer"):
        encode_frame(101, bytes(513))


@settings(max_examples=50, deadline=None)
@given(cuts=st.lists(st.integers(0, len(STREAM)), max_size=40))
def test_however_it_is_cut_the_frames_are_the_same(cuts):
    edges = [0, *sorted(cuts), len(STREAM)]
    frames, lost, rest = feed([STREAM[a:b] for a, b in pairwise(edges)])
    assert (frames, lost, rest) == (FRAMES, 0, b"")


@settings(max_examples=80, deadline=None)
@given(at=st.integers(0, len(STREAM) - 800), count=st.integers(1, 100), garbage=st.binary(max_size=100))
def test_losses_and_garbage_cost_only_the_frames_they_hit(at, count, garbage):
    damaged = STREAM[:at] + garbage + STREAM[at + count :]
    frames, lost, _ = feed([damaged[:at], damaged[at:]])
    assert sum(frame not in FRAMES for frame in frames) <= 1  # a sum of 8 bits lets one broken frame in 256 through
    assert len(frames) >= len(FRAMES) - 12
    assert frames[-1] == FRAMES[-1]
    assert damaged == STREAM or lost > 0 or frames != FRAMES


@settings(max_examples=80, deadline=None)
@given(data=st.binary(max_size=2000))
def test_noise_never_piles_up(data):
    parsed = parse_frames(data)
    assert parsed.consumed <= len(data)
    assert len(data) - parsed.consumed < 520
    assert parse_frames(data[parsed.consumed :]).frames == []


@settings(max_examples=80, deadline=None)
@given(st.binary(max_size=100))
def test_an_announcement_is_read_or_refused(data):
    try:
        info = parse_topic_info(data)
    except ValueError:
        return
    assert isinstance(info, TopicInfo)


def test_announcements_are_read():
    data = emulator.topic_info(125, "pose", "geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5")
    info = parse_topic_info(data)
    assert info == TopicInfo(125, "pose", "geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5", 512)


def test_the_md5s_are_those_of_the_layouts_we_read():
    for md5, layout in messages.LAYOUTS.items():
        if layout != messages.OLD_BATTERY:  # its constants are left out
            assert messages.TYPES.generate_msgdef(layout, ros_version=1)[1] == md5


@pytest.mark.parametrize(("layout", "size"), [("sensor_msgs/msg/BatteryState", 64), (messages.OLD_BATTERY, 56)])
def test_both_batteries_are_read(layout, size):
    floats = 7 if size == 64 else 6
    body = struct.pack("<IIII", 0, 0, 0, 0) + struct.pack(f"<{floats}f", 11.5, *[math.nan] * (floats - 1))
    payload = body + bytes(3) + b"\1" + bytes(size - len(body) - 4)
    assert messages.battery_of(messages.decode(layout, payload), 3.0).voltage_v == pytest.approx(11.5)


def announce(board, topic, name, md5, way=Id.PUBLISHER):
    board.handle(Frame(way, struct.pack("<H", topic) + encode_strings(name, "type", md5) + bytes(4)), 0.0)


def test_another_layout_is_refused_with_the_remedy():
    board = Board(BaseSettings())
    announce(board, 125, "pose", "0" * 32)
    assert re.search(r"pose.*unknown layout.*Flash", str(board.objection()))
    announce(board, 125, "pose", "d3812c3cbc69362b77dc0b19b345f8f5")  # the line had spoilt it
    assert "lacks" in str(board.objection())


def test_an_announcement_that_cannot_be_is_counted():
    board = Board(BaseSettings())
    announce(board, 99, "cmd_vel", "9f195f881246fdfa2798d1d3eebca84a", Id.SUBSCRIBER)  # would be a request for topics
    announce(board, 101, "cmd_vel", "9f195f88", Id.SUBSCRIBER)
    assert board.cmd_vel is None
    assert (board.unreadable, board.announced) == (2, 0)


def test_a_reading_that_is_not_finite_is_counted_and_does_not_stay_in_the_odometry():
    board = Board(BaseSettings())
    announce(board, 125, "pose", "d3812c3cbc69362b77dc0b19b345f8f5")
    for x in (1.0, math.nan, 1.1):
        board.handle(Frame(125, emulator.header(0.0, "odom") + struct.pack("<7d", x, 0, 0, 0, 0, 0, 1)), 0.0)
    assert board.unreadable == 1
    assert board.readings.odom.x_m == pytest.approx(0.1)


def test_topics_of_no_matter_may_have_any_layout():
    board = Board(BaseSettings())
    announce(board, 140, "joint_states", "0" * 32)
    announce(board, 141, "velocity_of_light", "0" * 32)
    board.handle(Frame(140, b"abc"), 0.0)
    assert (board.read, board.unreadable) == (0, 0)


def test_nothing_is_sent_to_what_was_not_announced():
    board = Board(BaseSettings())
    assert board.cmd_vel is None
    board.configure("EWCH", "1")
    assert board.calls(0.0) == b""
    assert not board.ready


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 200), st.binary(max_size=400))
def test_whatever_the_payload_the_board_is_not_confused(topic, payload):
    board = Board(BaseSettings())
    for number, (name, md5) in enumerate(
        [("pose", "d3812c3cbc69362b77dc0b19b345f8f5"), ("imu", "6a62c6daae103f4ff57a132d6f95cec2")], 125
    ):
        announce(board, number, name, md5)
    board.handle(Frame(topic, payload), 0.0)


def arc(radius_m, count, turn_rad=0.05):
    for i in range(count + 1):
        yaw = i * turn_rad
        yield Pose(radius_m * math.sin(yaw), radius_m * (1 - math.cos(yaw)), math.remainder(yaw, math.tau))


TRUE = BaseSettings(spin_slip_m_rad=0.0)


def test_odometry_is_in_the_bodys_frame():
    reckoner = Reckoner(TRUE)
    for pose in arc(1.0, 40):
        odom = reckoner.step(pose, (0.4 * math.cos(pose.yaw_rad), 0.4 * math.sin(pose.yaw_rad), 0.4), 1.0)
        assert (odom.linear_m_s, odom.angular_rad_s) == (pytest.approx(0.4), 0.4)
    assert (odom.x_m, odom.y_m, odom.yaw_rad) == pytest.approx((pose.x_m, pose.y_m, pose.yaw_rad), abs=0.002)


def test_calibration_corrects_turns_and_distances():
    reckoner = Reckoner(BaseSettings(distance_scale=1.1, turn_scale=1.12, spin_slip_m_rad=-0.0114))
    for i in range(101):
        yaw = i * 0.01
        odom = reckoner.step(Pose(-0.0114 * math.sin(yaw), 0.0114 * (math.cos(yaw) - 1), yaw), (0, 0, 0.5), 1.0)
    assert odom.yaw_rad == pytest.approx(1.12)
    assert math.hypot(odom.x_m, odom.y_m) < 1e-3
    assert odom.angular_rad_s == pytest.approx(0.56)


def test_a_board_that_counts_anew_does_not_throw_the_robot_about():
    reckoner = Reckoner(TRUE)
    reckoner.step(Pose(0.0, 0.0, 0.0), (0, 0, 0), 1.0)
    there = reckoner.step(Pose(0.1, 0.0, 0.0), (0, 0, 0), 1.0)
    reckoner.rebase()
    again = reckoner.step(Pose(0.0, 0.0, 0.0), (0, 0, 0), 1.0)
    assert (again.x_m, there.x_m) == (pytest.approx(0.1), pytest.approx(0.1))


@settings(max_examples=150, deadline=None)
@given(layout=st.sampled_from(sorted(messages.LAYOUTS.values())), payload=st.binary(max_size=512))
def test_a_payload_is_decoded_or_refused(layout, payload):
    with contextlib.suppress(SensorError):
        messages.decode(layout, payload)


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_a_session_of_the_board_spoilt_anywhere_is_survived(data):
    unit = emulated.Core2Unit(lambda _: None, lambda: Odometry(*[0.0] * 6), emulated.Firmware(boot_s=0.0))
    unit.receive(ASK_TOPICS, 0.0)
    session = bytearray(unit.emit(0.0) + unit.emit(0.5))
    for at in data.draw(st.lists(st.integers(0, len(session) - 1), max_size=8)):
        frame_at = session.rfind(b"\xff\xfe", 0, at + 1)
        session[at] = data.draw(st.integers(0, 255))
        reseal(session, frame_at)
    board, buffer = Board(BaseSettings()), b""
    for cut in range(0, len(session), 97):
        parsed = parse_frames(buffer + bytes(session[cut : cut + 97]))
        buffer = (buffer + bytes(session[cut : cut + 97]))[parsed.consumed :]
        for frame in parsed.frames:
            board.handle(frame, 1.0)
        board.calls(1.0)
    assert len(buffer) < 530
    assert board.cmd_vel is None or board.cmd_vel >= 100


def reseal(session, at):
    """Make the check of the frame that begins here right again, if its length is."""
    size = int.from_bytes(session[at + 2 : at + 4], "little") if at >= 0 else 0
    end = at + 7 + size
    if at >= 0 and end < len(session):
        session[end] = 255 - sum(session[at + 5 : end]) % 256
