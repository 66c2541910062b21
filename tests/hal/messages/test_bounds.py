"""What is beyond any use is no message: it is refused where it enters."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lira.hal.bus.topics import CMD_VEL, SCAN, TOPICS
from lira.hal.errors import CodecError
from lira.hal.messages import (
    STOP,
    Applied,
    BatteryState,
    CourseState,
    DiagnosticArray,
    DiagnosticStatus,
    Episode,
    Imu,
    Joy,
    LaserScan,
    Odometry,
    OperatorAnswer,
    Range,
    Twist,
)
from lira.hal.messages.bounds import LARGEST, LONGEST_TEXT, MOST_BEAMS, MOST_ITEMS
from lira.hal.messages.ros.codec import decode, decode_json, encode

NAN, INF = math.nan, math.inf
LAP = CourseState(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, NAN, NAN, INF)


def scan(beams=4, **changes):
    return replace(LaserScan(1.0, -1.0, 0.1, 0.1, 4.0, np.ones(beams, np.float32)), **changes)


def passes(message):
    try:
        decode(type(message), encode(message))
    except CodecError:
        return False
    return True


@pytest.mark.parametrize(
    "message",
    [
        Twist(NAN, INF),  # the governor stops the robot for it
        Applied(STOP, 1.0, session=2**64 - 1, seq=2**63 - 1),
        BatteryState(1_700_000_000.0, NAN),
        Range(1.0, "range_fl", INF, 0.1, 0.9),
        Range(1.0, "range_fl", -INF, 0.1, 0.9),
        LAP,
        scan(0),
        scan(MOST_BEAMS, angle_increment=1e-4),
        scan(ranges=np.array([NAN, INF, -INF, 0.0, -1.0], np.float32)),
        scan(range_max=INF),
        scan(angle_increment=-0.1),
        OperatorAnswer(1.0, words="x" * LONGEST_TEXT),
        Odometry(-0.001, 1.0, 2.0, 3.0, 0.0, 0.0),
    ],
)
def test_what_may_come_passes(message):
    assert passes(message)


@pytest.mark.parametrize(
    "message",
    [
        Applied(Twist(INF, 0.0), 1.0),
        Applied(STOP, 1.0, command_age_s=1e300),
        Odometry(1.0, NAN, 0.0, 0.0, 0.0, 0.0),
        Odometry(1.0, 1e300, 0.0, 0.0, 0.0, 0.0),
        Imu(1.0, 0.0, INF, 0.0, 0.0),
        BatteryState(1.0, INF),
        replace(LAP, x_m=INF),
        replace(LAP, clearance_m=2 * LARGEST),
        scan(MOST_BEAMS + 1, angle_increment=0.0),
        scan(angle_min=NAN),
        scan(angle_min=1e30),
        scan(angle_increment=NAN),
        scan(angle_increment=4.0),
        scan(range_min=-1.0),
        scan(range_max=NAN),
        scan(scan_time=INF),
        Joy(1.0, (INF,), ()),
        Joy(1.0, (0.0,) * (MOST_ITEMS + 1), ()),
        OperatorAnswer(1.0, words="x" * (LONGEST_TEXT + 1)),
        DiagnosticArray(1.0, (DiagnosticStatus(0, "a" * (LONGEST_TEXT + 1), "b"),)),
    ],
)
def test_what_is_out_of_bounds_is_no_message(message):
    assert not passes(message)


def test_a_topic_takes_what_its_type_needs():
    assert len(encode(STOP)) <= CMD_VEL.plain_bytes < 2 * len(encode(STOP))  # a stamped one is longer
    assert len(encode(scan(MOST_BEAMS))) <= SCAN.max_bytes
    assert all(topic.max_bytes <= 2**21 for topic in TOPICS)


@pytest.mark.parametrize(
    "words",
    [
        '{"start_m":1e308}',
        '{"start_m":-1e308}',
        '{"lateral_m":1e4}',
        '{"yaw_rad":1e300}',
        '{"began_m":1e20}',
        '{"layout":-1}',
        '{"layout":18446744073709551615}',
        '{"start_m":NaN}',
        "[" * 100_000,
    ],
)
def test_an_episode_that_nobody_could_mean_is_none(words):
    with pytest.raises(CodecError):
        decode_json(Episode, words.encode())


def test_an_episode_within_its_world_is_one():
    episode = Episode(2**32 - 1, 120.5, -0.5, 3.1, None)
    words = '{"layout":4294967295,"start_m":120.5,"lateral_m":-0.5,"yaw_rad":3.1,"began_m":null}'
    assert decode_json(Episode, words.encode()) == episode
