"""Every message that travels survives the wire, an independent decoder reads it, and garbage is a CodecError."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from lira.hal.errors import CodecError
from lira.hal.messages import (
    Applied,
    Clock,
    CompressedImage,
    Decision,
    Driver,
    Image,
    Imu,
    LaserScan,
    Odometry,
    Reason,
    Twist,
    TwistStamped,
)
from lira.hal.messages.compression import compress
from lira.hal.messages.ros.codec import CODECS, decode, encode, ros_type_of
from lira.hal.messages.ros.types import TYPES, definition
from lira.tools.bench.parts.samples import DECISION, INF, MESSAGES, NAN, of_kind

SCAN = of_kind(LaserScan)[0]


def fields(message: object) -> list[object]:
    """Comparable values, so that nan equals nan and arrays compare."""
    values = [getattr(message, name) for name in type(message).__dataclass_fields__]
    return [repr(v.tolist()) + str(v.shape) if isinstance(v, np.ndarray) else str(v) for v in values]


def independent(message: object) -> object:
    ros_type = ros_type_of(type(message))
    schema = Schema(data=definition(ros_type).encode(), encoding="ros2msg", id=1, name=ros_type)
    return DecoderFactory().decoder_for("cdr", schema)(encode(message))


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: type(m).__name__)
def test_round_trip(message):
    back = decode(type(message), encode(message))
    if isinstance(message, Odometry | Imu):  # the yaw passes through a quaternion
        assert back.yaw_rad == pytest.approx(message.yaw_rad)
        back, message = (
            type(m)(*(0.0 if n == "yaw_rad" else getattr(m, n) for n in m.__dataclass_fields__))
            for m in (back, message)
        )
    assert fields(back) == fields(message)


@pytest.mark.parametrize(("field", "word"), [("phase", "holiday"), ("call", "shout")])
def test_a_decision_in_a_phase_or_with_a_call_that_there_is_none_of_is_no_decision(field, word):
    ros = CODECS[Decision].to_ros(DECISION)
    setattr(ros, field, word)
    with pytest.raises(CodecError, match=word):
        decode(Decision, bytes(TYPES.serialize_cdr(ros, ros_type_of(Decision))))


def test_on_the_wire_who_drove_is_a_word():
    ros = CODECS[Decision].to_ros(replace(DECISION, driver=Driver.HUMAN))
    assert (type(ros.driver), ros.driver) == (str, "human")


def test_every_message_with_a_codec_is_tested():
    assert {type(message) for message in MESSAGES} == set(CODECS)


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: type(m).__name__)
def test_an_independent_decoder_reads_every_message(message):
    independent(message)


def test_an_independent_decoder_reads_the_same_values():
    scan = independent(SCAN)
    assert scan.header.stamp.sec == 2
    assert scan.header.stamp.nanosec == 500_000_000
    assert repr(list(scan.ranges)) == "[1.0, inf, -inf, nan, 0.5]"
    assert scan.angle_max == 0.0
    twist = independent(Twist(NAN, -INF))
    assert math.isnan(twist.linear.x)
    assert twist.angular.z == -INF
    assert twist.linear.y == 0.0
    decision = independent(DECISION)
    assert [(e.name, list(e.action), e.active) for e in decision.experts] == [
        ("camera", [0.5, -1.0], True),
        ("lidar", [1.0, 0.25], False),
    ]
    assert (decision.has_human, decision.labels.demonstration, decision.phase) == (False, 5, "train")
    applied = independent(of_kind(Applied)[1])
    assert (list(applied.clamps), applied.answers, applied.reason) == (["linear", "angular"], 77, "ok")
    odometry = independent(of_kind(Odometry)[0])
    assert odometry.pose.pose.orientation.z == pytest.approx(math.sin(0.375))
    assert odometry.twist.twist.angular.z == -0.25


def test_big_endian_senders_are_read():
    ros = TYPES.deserialize_cdr(encode(SCAN), "sensor_msgs/msg/LaserScan")
    data = bytes(TYPES.serialize_cdr(ros, "sensor_msgs/msg/LaserScan", little_endian=False))
    assert fields(decode(LaserScan, data)) == fields(SCAN)


def test_a_stamp_survives_to_the_nanosecond():
    assert decode(Clock, encode(Clock(123456.000000789))).stamp_s == pytest.approx(123456.000000789, abs=1e-9)
    assert decode(Clock, encode(Clock(-0.25))).stamp_s == -0.25


@pytest.mark.parametrize(
    "message",
    [
        Clock(NAN),
        Clock(INF),
        Clock(1e300),
        Image(1.0, np.zeros((2, 2), np.uint8), "rgb8"),
        Image(1.0, np.zeros((2, 2), np.uint8), "yuv"),
        Applied(Twist(0.0, 0.0), 1.0, answers=2**70),
    ],
    ids=["nan", "inf", "huge", "shape", "encoding", "range"],
)
def test_what_ros_cannot_hold_is_refused(message):
    with pytest.raises(CodecError):
        encode(message)


def test_unknown_words_are_refused():
    data = encode(Applied(Twist(0.0, 0.0), 1.0, reason=Reason.STALE))
    with pytest.raises(CodecError):
        decode(Applied, data.replace(b"stale", b"stole"))


def test_a_png_with_a_part_longer_than_itself_is_refused():
    picture = compress(Image(1.0, np.zeros((8, 8, 3), np.uint8)), "png")
    assert decode(CompressedImage, encode(picture)) == picture
    for length in (b"\xff\xff\xff\x7f", b"\x7f\xff\xff\xff", b"\0\0\1\0"):
        bad = picture.data[:33] + length + picture.data[37:]
        with pytest.raises(CodecError, match="longer than the picture"):
            decode(CompressedImage, encode(CompressedImage(1.0, bad, "png")))


def test_an_image_that_lies_about_its_size_is_refused():
    ros = TYPES.deserialize_cdr(encode(of_kind(Image)[0]), "sensor_msgs/msg/Image")
    ros.height = 2**31
    with pytest.raises(CodecError):
        decode(Image, bytes(TYPES.serialize_cdr(ros, "sensor_msgs/msg/Image")))


def mutate(good: bytes, rng: random.Random) -> bytes:
    data = bytearray(good)
    choice = rng.randrange(5)
    if choice == 0:
        return bytes(data[: rng.randrange(len(data))])
    if choice == 1:
        return rng.randbytes(rng.randrange(200))
    if choice == 2:
        return b"\x00\x01\x00\x00" + rng.randbytes(rng.randrange(200))
    if choice == 3:
        at = rng.randrange(len(data) - 3)
        data[at : at + 4] = rng.choice([b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\x00\x00\x00\x80"])
        return bytes(data)
    for _ in range(rng.randrange(1, 5)):
        data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: type(m).__name__)
def test_garbage_is_a_codec_error_and_nothing_else(message):
    rng = random.Random(2021)
    good = encode(message)
    refused = 0
    for _ in range(400):
        try:
            decode(type(message), mutate(good, rng))
        except CodecError:
            refused += 1
    assert refused > 0


def test_a_velocity_with_a_stamp_is_never_taken_for_one_without_or_the_other_way_round():
    with pytest.raises(CodecError):
        decode(Twist, encode(TwistStamped(2.5, Twist(0.5, -1.5))))
    with pytest.raises(CodecError):
        decode(TwistStamped, encode(Twist(0.5, -1.5)))
