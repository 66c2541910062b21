"""The estimate of the robot's clock."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lira.hal.clock import HEAL_S, LEAP_S, SILENT_S, ClockEstimate


def test_the_most_prompt_message_counts():
    clock = ClockEstimate()
    assert not clock.known
    for local_s, delay_s in ((10.0, 0.05), (10.05, 0.002), (10.1, 0.2)):
        clock.note(local_s + 100.0 - delay_s, local_s)
    assert clock.known
    assert clock.now(10.1) == pytest.approx(110.098)


def test_it_is_never_ahead_of_a_robot_whose_time_runs_as_ours():
    clock = ClockEstimate()
    for step in range(100):
        local_s = step * 0.05
        clock.note(local_s - 5.0 - 0.01 * (step % 7), local_s)
        assert clock.now(local_s) <= local_s - 5.0 + 1e-9


@given(st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 5.0)), min_size=1, max_size=40), st.floats(0.0, 1.0))
def test_no_delays_make_a_command_look_younger_than_it_is(messages, later_s):
    """Every message left the robot before it came: whatever the delays, the estimate stays behind the robot's clock."""
    clock, local_s = ClockEstimate(), 100.0
    for passed_s, delay_s in messages:
        local_s += passed_s
        clock.note(local_s + 7.0 - delay_s, local_s)
        assert clock.now(local_s) <= local_s + 7.0 + 1e-9
    assert clock.now(local_s + later_s) <= local_s + later_s + 7.0 + 1e-9


@pytest.mark.parametrize("rate", [0.25, 0.5, 0.7, 0.95])
@pytest.mark.parametrize("period_s", [0.02, 0.05, 0.1, 0.2])
def test_it_runs_no_further_ahead_of_a_slower_robot_than_a_command_may(rate, period_s):
    """A slow twin speaks more rarely, too: at 20 Hz on its own clock, and a stamp that is far ahead is refused."""
    clock, ahead_s = ClockEstimate(), []
    for step in range(400):
        local_s = 50.0 + 0.005 * step
        if step % round(period_s / 0.005) == 0:
            clock.note(rate * local_s, local_s)
        ahead_s.append(clock.now(local_s) - rate * local_s)
    assert max(ahead_s) <= 0.15  # before there was anything to measure
    assert max(ahead_s[200:]) <= 0.01
    assert min(ahead_s) >= -0.001


def test_a_twin_that_gets_too_slow_for_its_machine_is_followed():
    clock, robot_s, ahead_s = ClockEstimate(), 0.0, []
    for step in range(2000):
        local_s = 0.005 * step
        robot_s += 0.005 * (1.0 if step < 600 else 0.4)
        if step % 10 == 0:
            clock.note(robot_s - 0.003 * (step % 3), local_s)
        ahead_s.append(clock.now(local_s) - robot_s)
    assert max(ahead_s[:600]) <= 1e-9
    assert max(ahead_s[900:]) <= 0.02


def test_a_robot_whose_time_runs_as_ours_again_is_caught_up_with_at_once():
    clock, robot_s = ClockEstimate(), 0.0
    for step in range(400):
        local_s = 0.05 * step
        robot_s += 0.05 * (0.4 if step < 200 else 1.0)
        clock.note(robot_s, local_s)
        assert clock.now(local_s) >= robot_s - 1e-9  # never behind its newest word


@pytest.mark.parametrize("rate", [0.0, 0.4, 1.0])
def test_what_was_heard_last_grows_old_once_the_robot_is_silent(rate):
    """However slow its time seemed: delays that grow until nothing comes any more look like a clock that stops."""
    clock = ClockEstimate()
    for step in range(40):
        clock.note(rate * 0.05 * step, 0.05 * step)
    newest_s, silent_s = rate * 0.05 * 39, 0.05 * 39
    assert clock.now(silent_s + 1.0) - newest_s >= 0.75


def test_it_never_runs_back():
    clock = ClockEstimate()
    clock.note(100.0, 10.0)
    clock.note(100.2, 10.3)
    seen = [clock.now(10.3)]
    clock.note(100.3, 10.6)
    seen.append(clock.now(10.6))
    clock.note(100.3, 10.9)
    seen.append(clock.now(10.9))
    assert seen == sorted(seen)


def test_a_restarted_robot_starts_a_new_estimate():
    clock = ClockEstimate()
    clock.note(1000.0, 10.0)
    clock.now(10.0)
    clock.restart()
    assert not clock.known
    clock.note(1.0, 11.0)
    assert clock.now(11.5) == 1.5


def test_one_message_from_far_ahead_does_not_hold_it():
    clock, local_s = ClockEstimate(), 10.0
    for step in range(40):
        local_s = 10.0 + 0.05 * step
        clock.note(local_s + 100.0, local_s)
        clock.note(local_s + 100.0 + (LEAP_S + 0.01 if step % 2 else 1e6), local_s)
        assert clock.now(local_s) == pytest.approx(local_s + 100.0)


def test_a_clock_that_was_set_ahead_is_followed():
    clock = ClockEstimate()
    clock.note(100.0, 10.0)
    for local_s in (10.5, 10.9):
        clock.note(local_s + 5000.0, local_s)
        assert clock.now(local_s) == pytest.approx(local_s + 90.0)
    local_s = 10.0 + HEAL_S
    clock.note(local_s + 5000.0, local_s)
    assert clock.now(local_s) == pytest.approx(local_s + 5000.0)


def test_what_was_held_back_for_seconds_and_what_follows_it_are_followed():
    clock = ClockEstimate()
    clock.note(100.0, 10.0)
    for step in range(60):
        clock.note(100.0 + 0.05 * step, 13.0)  # three seconds' messages in one burst
    clock.note(103.0, 13.0)
    assert clock.now(13.0) == pytest.approx(103.0)


def test_who_speaks_between_a_robots_words_is_not_the_robot():
    clock = ClockEstimate()
    for step in range(40):
        local_s = 10.0 + 0.05 * step
        assert clock.hear(1, local_s + 100.0, local_s)
        assert not clock.hear(2 + step, 1e6, local_s + 0.01)
        assert clock.now(local_s) == pytest.approx(local_s + 100.0)


def test_a_robot_that_was_silent_and_has_another_session_was_started_anew():
    clock = ClockEstimate()
    assert clock.hear(1, 1000.0, 10.0)
    assert clock.now(10.0) == 1000.0
    assert not clock.hear(2, 1.0, 10.0 + SILENT_S - 0.01)
    assert clock.hear(2, 1.0, 10.0 + SILENT_S)
    assert clock.now(10.0 + SILENT_S) == 1.0


def test_for_who_lets_commands_expire_by_it_time_never_slows_down():
    """Delays that grow and then nothing: a governor that goes by an estimate of 0 would let no command expire."""
    clock = ClockEstimate(even=True)
    for step in range(100):
        clock.note(100.0 + 0.02 * step, 0.02 * step + 0.018 * step)  # hardly any of it comes on time
    before_s = clock.now(3.8)
    assert clock.now(4.3) == pytest.approx(before_s + 0.5)
