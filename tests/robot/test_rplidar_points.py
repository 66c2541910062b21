import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lira.robot.rplidar import protocol
from lira.robot.rplidar.points import Points, parse_dense, parse_express, parse_standard
from lira.robot.rplidar.protocol import Answer
from lira.sim_backend.emulators.rplidar import encode_dense, encode_express, encode_nodes, seal

STEP_RAD = math.radians(0.9)


def sweep(count, step_rad=STEP_RAD, start_rad=0.3):
    """Angles of a turning head, and a distance for each that no two share."""
    theta = (start_rad + np.arange(count) * step_rad) % math.tau
    return theta, 0.5 + np.arange(count) * 0.004


def standard_stream():
    theta, distance = sweep(600)
    return encode_nodes(theta, distance), theta, distance


def express_stream():
    theta, distance = sweep(32 * 24)
    return encode_express(theta[::32], distance.reshape(-1, 32), first=True), theta, distance


def dense_stream():
    theta, distance = sweep(40 * 24, math.radians(0.225))
    return encode_dense(theta[::40], distance.reshape(-1, 40), first=True), theta, distance


STREAMS = {
    "standard": (parse_standard, standard_stream(), 5),
    "express": (parse_express, express_stream(), 84),
    "dense": (parse_dense, dense_stream(), 84),
}


@pytest.fixture(params=STREAMS)
def stream(request):
    return STREAMS[request.param]


def feed(parse, pieces):
    """Parse pieces as they come; returns all points, and the bytes lost."""
    buffer, found, lost = b"", [], 0
    for piece in pieces:
        buffer += piece
        points = parse(buffer)
        assert 0 <= points.consumed <= len(buffer)
        buffer = buffer[points.consumed :]
        found.append(points)
        lost += points.lost
    theta, distance = (np.concatenate([getattr(p, name) for p in found]) for name in ("theta_rad", "distance_m"))
    return theta, distance, lost, len(buffer)


def split(data, cuts):
    edges = [0, *sorted(cut % len(data) for cut in cuts), len(data)]
    return [data[a:b] for a, b in pairwise(edges)]


def circular(difference):
    return np.abs((difference + math.pi) % math.tau - math.pi)


def true_points(theta, distance, true_theta, true_distance):
    """How many of the points are points that were sent."""
    order = np.argsort(true_distance)
    near = order[np.clip(np.searchsorted(true_distance[order], distance - 0.002), 0, len(order) - 1)]
    same = (np.abs(true_distance[near] - distance) < 0.001) & (circular(true_theta[near] - theta) < math.radians(0.5))
    return int(np.count_nonzero(same))


def test_every_point_comes_through(stream):
    parse, (data, theta, distance), _ = stream
    got_theta, got_distance, lost, _ = feed(parse, [data])
    assert lost == 0
    count = len(got_theta)
    assert count >= len(theta) - 40
    assert np.max(circular(got_theta - theta[:count])) < math.radians(0.02)
    assert got_distance == pytest.approx(distance[:count], abs=0.0006)


def test_the_newest_packet_waits_and_says_so(stream):
    parse, (data, theta, _), _ = stream
    points = parse(data)
    assert len(points) + points.waiting == len(theta)


@settings(max_examples=40, deadline=None)
@given(name=st.sampled_from(sorted(STREAMS)), cuts=st.lists(st.integers(0, 10**6), max_size=30))
def test_however_it_is_cut_the_points_are_the_same(name, cuts):
    parse, (data, _, _), _ = STREAMS[name]
    whole, pieces = feed(parse, [data]), feed(parse, split(data, cuts))
    count = len(pieces[0])
    assert len(whole[0]) - 3 < count <= len(whole[0])  # a last node or two may wait for more to be sure
    np.testing.assert_array_equal(whole[0][:count], pieces[0])
    np.testing.assert_array_equal(whole[1][:count], pieces[1])
    assert whole[2] == pieces[2] == 0


@settings(max_examples=40, deadline=None)
@given(name=st.sampled_from(sorted(STREAMS)), at=st.integers(0, 10**6), count=st.integers(1, 200))
def test_lost_bytes_cost_a_few_packets_and_are_counted(name, at, count):
    parse, (data, theta, distance), size = STREAMS[name]
    at %= len(data) - 8 * size
    got_theta, got_distance, lost, left = feed(parse, [data[:at] + data[at + count :]])
    per_packet = len(theta) / (len(data) / size)
    # Whole packets vanish without a trace: the packet before them is stretched over the gap.
    stretched = per_packet if count % size == 0 else 0
    assert true_points(got_theta, got_distance, theta, distance) >= len(got_theta) - 2 - stretched
    gone = (count // size + 6) * per_packet + 6
    assert len(got_theta) >= len(theta) - gone - 40
    if count % size:
        assert lost > 0
    assert left < 2 * size + 15


@settings(max_examples=40, deadline=None)
@given(name=st.sampled_from(sorted(STREAMS)), at=st.integers(0, 10**6), garbage=st.binary(min_size=1, max_size=300))
def test_after_garbage_it_finds_its_way_back(name, at, garbage):
    parse, (data, theta, distance), size = STREAMS[name]
    at %= len(data) - 8 * size
    got_theta, got_distance, lost, _ = feed(parse, [data[:at], garbage, data[at:]])
    bad = len(got_theta) - true_points(got_theta, got_distance, theta, distance)
    assert bad <= 2 + len(garbage) // 5 * (name == "standard")  # its two check bits let some noise through
    assert len(got_theta) >= len(theta) - 4 * 40 - (bad if name == "standard" else 0)
    assert lost >= 0


@settings(max_examples=60, deadline=None)
@given(name=st.sampled_from(sorted(STREAMS)), at=st.integers(0, 10**6), flip=st.integers(1, 255))
def test_a_corrupt_byte_costs_at_most_the_packets_beside_it(name, at, flip):
    parse, (data, theta, distance), size = STREAMS[name]
    at %= len(data)
    spoilt = bytearray(data)
    spoilt[at] ^= flip
    got_theta, got_distance, _, _ = feed(parse, [bytes(spoilt)])
    per_packet = round(len(theta) / (len(data) / size))
    assert len(got_theta) >= len(theta) - 4 * per_packet - 40
    # Only a distance in a standard node has no check at all.
    assert true_points(got_theta, got_distance, theta, distance) >= len(got_theta) - (name == "standard")


@settings(max_examples=60, deadline=None)
@given(parse=st.sampled_from([parse_standard, parse_express, parse_dense]), data=st.binary(max_size=600))
def test_noise_is_never_an_error_and_never_piles_up(parse, data):
    points: Points = parse(data)
    assert len(data) - points.consumed < 4 * 84
    assert np.all((points.theta_rad >= 0.0) & (points.theta_rad < math.tau))


def test_express_corrections_are_subtracted():
    cabin = bytes([0b10 | (1000 << 2) & 0xFF, 1000 << 2 >> 8, (2000 << 2) & 0xFF, 2000 << 2 >> 8, 0x14])
    data = seal(1.0, cabin * 16, begins=True) + seal(1.2, cabin * 16)
    points = parse_express(data)
    first, second = 0b100100 / 8, 0b000001 / 8  # two high bits beside the distance, four low ones at the end
    degrees = np.degrees(points.theta_rad[:2] - 1.0)
    assert degrees == pytest.approx([-first, math.degrees(0.2) / 32 - second], abs=0.02)
    assert points.distance_m[:2] == pytest.approx([1.0, 2.0])


def test_a_capsule_that_begins_a_stream_does_not_continue_the_old_one():
    body = bytes(80)
    old, new = seal(1.0, body), seal(1.2, body, begins=True) + seal(1.4, body)
    points = parse_dense(old + new)
    assert len(points) == 40
    assert points.theta_rad[0] == pytest.approx(1.2, abs=0.001)
    assert points.lost == 84


def test_a_whole_capsule_lost_is_not_stretched_over():
    theta, distance = sweep(32 * 4)
    capsules = encode_express(theta[::32], distance.reshape(-1, 32))
    points = parse_express(capsules[:84] + capsules[168:])
    assert len(points) == 32
    assert points.theta_rad[0] == pytest.approx(theta[64], abs=0.001)


def head(encode, count, rate_hz, sample_s, capsules=60):
    """Capsules of a head that turns at a speed, one by one, and how far apart they begin."""
    theta, distance = sweep(count * capsules, math.tau * rate_hz * sample_s)
    stream = encode(theta[::count], distance.reshape(-1, count))
    return [stream[at : at + 84] for at in range(0, len(stream), 84)], theta, distance


EXPRESS_HEADS = [
    (rate_hz, sample_s) for rate_hz in (2.0, 5.5, 10.0, 15.0, 17.5, 20.0) for sample_s in (250e-6, 476e-6, 508e-6)
]


@pytest.mark.parametrize(("rate_hz", "sample_s"), EXPRESS_HEADS)
def test_every_speed_of_the_head_is_understood_and_a_lost_capsule_costs_no_more_than_its_neighbour(rate_hz, sample_s):
    capsules, theta, distance = head(encode_express, 32, rate_hz, sample_s)
    stream, got, lost = Pieces(parse_express), [], 0
    for number, capsule in enumerate(capsules):
        if number != 40:
            points = stream.feed(capsule)
            got.append(points)
            lost += points.lost
    found = sum(len(points) for points in got)
    assert found == (60 - 1 - 2) * 32  # the newest waits; the lost one, and the one that it should have followed
    assert lost == 84
    together = [np.concatenate([getattr(points, name) for points in got]) for name in ("theta_rad", "distance_m")]
    assert true_points(*together, theta, distance) == found


class Pieces:
    """A stream as the driver reads it: it remembers what capsules span."""

    def __init__(self, parse):
        self.parse, self.buffer, self.spans = parse, b"", []

    def feed(self, data):
        self.buffer += data
        usual_deg = float(np.median(self.spans[-15:])) if len(self.spans) > 5 else math.inf
        points = self.parse(self.buffer, usual_deg)
        self.buffer = self.buffer[points.consumed :]
        self.spans += points.span_deg.tolist()
        return points


@pytest.mark.parametrize("parse", [parse_express, parse_dense])
@pytest.mark.parametrize(
    "second", [seal(math.radians(9.0), bytes(80), begins=True), seal(math.radians(200.0), bytes(80))]
)
def test_two_capsules_of_which_none_follows_the_other_are_no_error(parse, second):
    points = parse(seal(0.0, bytes(80)) + second)
    assert (len(points), points.lost) == (0, 84)


@settings(max_examples=60, deadline=None)
@given(
    angles=st.lists(st.floats(0.0, math.tau), max_size=40),
    begins=st.sets(st.integers(0, 40)),
    parse=st.sampled_from([parse_express, parse_dense]),
    body=st.binary(min_size=80, max_size=80),
    usual_deg=st.floats(0.0, 360.0) | st.just(math.inf),
)
def test_legal_capsules_in_any_order_are_no_error(angles, begins, parse, body, usual_deg):
    data = b"".join(seal(angle, body, begins=number in begins) for number, angle in enumerate(angles))
    points = parse(data, usual_deg)
    assert len(data) - points.consumed <= 84
    assert np.all((points.theta_rad >= 0.0) & (points.theta_rad < math.tau))


@settings(max_examples=80, deadline=None)
@given(
    noise=st.binary(max_size=60), size=st.integers(0, 2**30 - 1), kind=st.sampled_from(list(Answer)), body=st.binary()
)
def test_an_answer_is_found_whole_or_not_at_all(noise, size, kind, body):
    data = noise + protocol.encode_descriptor(protocol.Descriptor(size, stream=False, kind=kind)) + body
    found = protocol.find_any_answer(data, kind)
    assert found is None or len(found) <= len(data)
    protocol.parse_conf(found or b"", protocol.Conf.US_PER_SAMPLE)
    stream = protocol.find_stream(data, kind)
    assert stream is None or data.endswith(stream)
