"""How old a command from a ROS graph is, whose it is, and which is none."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lira.hal.rmw.attachment import RmwAttachment
from lira.tools.ros2.commanders import MOST, NO_ORDER, NO_SENDER, OTHER_CLOCK, Commanders, Order, SenderClock

UNIX_S = 1_800_000_000.0
GID = bytes(range(16))


def attached(number, sent_s, gid=GID):
    return RmwAttachment(number, round((UNIX_S + sent_s) * 1e9), gid)


def test_the_age_is_what_a_command_took_longer_than_the_quickest():
    commanders = Commanders(b"salt")
    ages = [
        commanders.judge(attached(number, sent_s), 0.0, arrived_s).age_s
        for number, (sent_s, arrived_s) in enumerate([(0.0, 100.02), (0.1, 100.11), (0.2, 103.21), (3.3, 103.32)])
    ]
    assert ages == pytest.approx([0.0, 0.0, 3.0, 0.01], abs=5e-3)


def test_what_a_gap_held_back_is_old_even_if_nothing_else_came_for_long():
    clock = SenderClock()
    assert clock.age(0.0, 0.0) == 0.0
    held = [clock.age(1.0 + 0.05 * number, 31.0) for number in range(20)]
    assert min(held) > 28.9


def test_a_stamp_adds_the_time_from_deciding_to_sending():
    order = Commanders(b"salt").judge(attached(1, 5.0), UNIX_S + 4.8, 0.0)
    assert order.age_s == pytest.approx(0.2, abs=1e-3)
    assert Commanders(b"salt").judge(attached(1, 5.0), UNIX_S + 5.0, 0.0).age_s == pytest.approx(0.0, abs=1e-3)
    # Of simulated time, or of a clock that runs ahead.
    assert Commanders(b"salt").judge(attached(1, 5.0), 17.0, 0.0).age_s > 1e9
    assert Commanders(b"salt").judge(attached(1, 5.0), UNIX_S + 6.0, 0.0) == OTHER_CLOCK


def test_everybody_is_a_commander_of_their_own_and_nobody_can_be_another():
    one, other = Commanders(b"salt"), Commanders(b"pepper")
    first, second = (one.judge(attached(1, 0.0, gid), 0.0, 0.0).epoch for gid in (GID, GID[::-1]))
    assert first != second
    assert one.judge(attached(2, 0.1), 0.0, 0.1).epoch == first
    assert other.judge(attached(1, 0.0), 0.0, 0.0).epoch != first


def test_what_has_no_sender_or_comes_twice_is_none():
    commanders = Commanders(b"salt")
    assert commanders.judge(None, 0.0, 0.0) == NO_SENDER
    assert isinstance(commanders.judge(attached(0, 0.0), 0.0, 0.0), Order)
    assert commanders.judge(attached(0, 0.0), 0.0, 0.1) == NO_ORDER
    assert commanders.judge(attached(-5, 0.0), 0.0, 0.2) == NO_ORDER


@given(
    st.lists(
        st.tuples(
            st.integers(-(2**63), 2**63 - 1),
            st.integers(-(2**63), 2**63 - 1),
            st.binary(min_size=16, max_size=16),
            st.floats(allow_nan=True, allow_infinity=True),
        ),
        max_size=30,
    )
)
def test_whatever_comes_is_an_order_in_bounds_or_none(samples):
    commanders = Commanders(b"salt")
    for at, (number, time_ns, gid, stamp_s) in enumerate(samples):
        order = commanders.judge(RmwAttachment(number, time_ns, gid), stamp_s, float(at))
        if isinstance(order, Order):
            assert 0 <= order.epoch < 2**64
            assert 0 <= order.seq < 2**63
            assert order.age_s >= 0.0 or math.isnan(order.age_s)


def test_a_crowd_is_not_remembered_for_ever():
    commanders = Commanders(b"salt")
    for number in range(10 * MOST):
        commanders.judge(attached(0, 0.0, number.to_bytes(16)), 0.0, 0.0)
    assert len(commanders._known) == MOST
