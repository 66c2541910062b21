"""The governor over every state and event, its rules one by one, and properties over any sequence."""

import math
from dataclasses import replace

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lira.hal.messages import STOP, Command, Reason, Source, Twist, is_neutral, session_of
from lira.hal.profile import STOP_BUDGET_S, load_profile
from lira.hal.safety.arming import TRANSITIONS, Event, State
from lira.hal.safety.governor import GRACE_S, Governor

PROFILE, ROSBOT = load_profile("thesis-sim"), load_profile("rosbot2")
POLICY_S, TELEOP_S = PROFILE.control.policy_timeout_s, PROFILE.control.teleop_timeout_s
GO, TURN = Twist(0.5, 0.0), Twist(0.0, 0.5)
P, T = Source.POLICY, Source.TELEOP


class Desk:
    """Talks to a governor at explicit times."""

    def __init__(self) -> None:
        self.governor = Governor(PROFILE)

    def at(self, now_s, *commands):
        for command in commands:
            self.governor.submit(command, now_s)
        return self.governor.tick(now_s)

    def armed(self, now_s=0.0, source=P):
        assert self.at(now_s, Command(STOP, now_s, source)).reason is Reason.OK
        return self


def policy(twist, stamp_s, answers=-1):
    return Command(twist, stamp_s, P, answers)


def teleop(twist, stamp_s, released=False):
    return Command(twist, stamp_s, T, released=released)


def test_the_table_covers_every_state_and_event():
    assert set(TRANSITIONS) == {(state, event) for state in State for event in Event}


D, A, S, L, E = State.DISARMED, State.ARMED, State.STOPPED, State.LOST, State.EMERGENCY
LOST, ESTOP = (L, Reason.STALE), (E, Reason.ESTOP)
FIRST = Reason.NEUTRAL_FIRST
EXPECTED = {  # by state: disarmed, armed, stopped, lost, emergency
    Event.NEUTRAL: ((A, Reason.OK), (A, Reason.OK), (A, Reason.OK), LOST, ESTOP),
    Event.MOTION: ((D, FIRST), (A, Reason.OK), (S, FIRST), LOST, ESTOP),
    Event.RESUMED: ((D, FIRST), (S, FIRST), (S, FIRST), LOST, ESTOP),
    Event.EXPIRED: ((D, Reason.STALE), (S, Reason.STALE), (S, Reason.STALE), LOST, ESTOP),
    Event.BROKEN: ((D, Reason.REFUSED), (S, Reason.REFUSED), (S, Reason.REFUSED), LOST, ESTOP),
    Event.IGNORED: ((D, Reason.REFUSED), (A, Reason.OK), (S, Reason.REFUSED), LOST, ESTOP),
    Event.HALTED: (*((D, Reason.NO_COMMAND),) * 3, LOST, ESTOP),
    Event.LOST: (*(LOST,) * 4, ESTOP),
    Event.FOUND: ((D, FIRST), (A, Reason.OK), (S, FIRST), (S, FIRST), ESTOP),
    Event.PRESSED: (ESTOP,) * 5,
    Event.RELEASED: ((D, FIRST), (A, Reason.OK), (S, FIRST), LOST, (S, FIRST)),
}


def test_the_table_is_what_it_should_be():
    table = {(state, event): then for event, row in EXPECTED.items() for state, then in zip(State, row, strict=True)}
    assert table == TRANSITIONS
    assert {event for (_, event), (then, _) in TRANSITIONS.items() if then is A} == {
        Event.NEUTRAL, *(event for (state, event), (then, _) in TRANSITIONS.items() if state is then is A)
    }  # fmt: skip


def in_state(state):
    """A governor that got into a state by events, with a live motion command at 10.0 where that is possible."""
    desk = Desk()
    if state is S:
        desk.armed(9.0)
        desk.at(9.5)
    if state is A:
        desk.armed(10.0)
    if state is L:
        desk.governor.note_devices(("lidar",), 1)
    if state is E:
        desk.governor.press()
    desk.at(10.0, policy(GO, 10.0))
    assert desk.governor.state is state
    return desk


@pytest.mark.parametrize("event", sorted(set(Event) - {Event.RESUMED, Event.FOUND}))
@pytest.mark.parametrize("state", State)
def test_every_event_in_every_state(event, state):
    desk = in_state(state)
    happen = {
        Event.NEUTRAL: lambda: desk.at(10.1, policy(STOP, 10.1)),
        Event.MOTION: lambda: desk.at(10.1, policy(GO, 10.1)),
        Event.EXPIRED: lambda: desk.at(11.0),
        Event.BROKEN: lambda: desk.at(10.1, policy(Twist(math.nan, 0.0), 10.1)),
        Event.IGNORED: lambda: desk.at(10.1, policy(GO, 9.0)),
        Event.HALTED: lambda: (desk.governor.halt(), desk.at(10.1))[1],
        Event.LOST: lambda: (desk.governor.note_devices(("lidar",), 1), desk.at(10.1))[1],
        Event.PRESSED: lambda: (desk.governor.press(), desk.at(10.1))[1],
        Event.RELEASED: lambda: (desk.governor.release(10.1), desk.at(10.1))[1],
    }
    applied = happen[event]()
    assert (desk.governor.state, applied.reason) == TRANSITIONS[state, event]
    if desk.governor.state is not A:
        assert (applied.twist, applied.source) == (STOP, Source.NONE)


@pytest.mark.parametrize("state", State)
def test_a_hand_that_went_on_through_a_stop_does_not_move_by_another_ones_zero(state):
    desk = Desk().armed(9.9, T)
    desk.at(9.95, teleop(GO, 9.95))
    assert desk.at(10.2).reason is Reason.STALE
    happen = {D: desk.governor.halt, L: lambda: desk.governor.note_devices(("base",), 1), E: desk.governor.press}
    happen.get(state, lambda: None)()
    if state is A:
        desk.armed(10.25)
    assert desk.governor.state is state
    applied = desk.at(10.3, teleop(GO, 10.3), policy(STOP, 10.3))
    assert (desk.governor.state, applied.reason) == TRANSITIONS[state, Event.RESUMED]
    assert applied.twist == STOP


def test_at_the_start_nothing_moves_and_it_says_why():
    applied = Desk().at(5.0)
    assert (applied.twist, applied.source, applied.reason) == (STOP, Source.NONE, Reason.NO_COMMAND)
    assert applied.answers == -1
    assert math.isnan(applied.command_age_s)


def test_a_neutral_command_comes_first():
    desk = Desk()
    assert desk.at(0.0, policy(GO, 0.0)).reason is Reason.NEUTRAL_FIRST
    assert desk.at(0.1, policy(STOP, 0.1)).reason is Reason.OK
    assert desk.at(0.2, policy(GO, 0.2)).twist == GO


def test_what_is_applied_names_its_command():
    applied = Desk().armed().at(0.15, policy(GO, 0.1, answers=7))
    assert (applied.source, applied.reason, applied.answers, applied.clamps) == (P, Reason.OK, 7, ())
    assert applied.command_age_s == pytest.approx(0.05)
    assert applied.stamp_s == 0.15


def test_the_watchdog_strikes_at_the_time_out_and_wants_a_neutral_command():
    desk = Desk().armed()
    assert desk.at(0.1, policy(GO, 0.1)).twist == GO
    assert desk.at(0.1 + POLICY_S - 0.01).twist == GO
    assert desk.at(0.1 + POLICY_S).reason is Reason.STALE
    assert desk.at(1.0, policy(GO, 1.0)).reason is Reason.NEUTRAL_FIRST
    desk.armed(1.1)
    assert desk.at(1.2, policy(GO, 1.2)).twist == GO


@given(st.lists(st.tuples(st.sampled_from([P, T]), st.sampled_from([STOP, GO, TURN]), st.floats(0.0, 0.3)), max_size=8))
def test_until_what_is_said_to_be_steady_ends_nothing_else_is_said(commands):
    desk, now_s = Desk(), 0.0
    for source, twist, passed_s in commands:
        now_s += passed_s
        said = desk.at(now_s, Command(twist, now_s, source))
    if not commands:
        said = desk.at(now_s)
    end_s = desk.governor.steady_until(now_s)
    last_s = min(end_s, now_s + 1.0)
    for share in (0.25, 0.5, 0.99):
        later = desk.at(now_s + share * (last_s - now_s))
        assert (later.twist, later.source, later.reason) == (said.twist, said.source, said.reason)


def test_what_a_command_moves_is_steady_until_its_time_out():
    desk = Desk().armed()
    desk.at(0.1, policy(GO, 0.1))
    assert desk.governor.steady_until(0.1) == pytest.approx(0.1 + POLICY_S)
    assert desk.at(desk.governor.steady_until(0.1)).reason is Reason.STALE
    assert desk.governor.steady_until(0.5) == math.inf


@pytest.mark.parametrize("profile", [ROSBOT, msgspec.structs.replace(ROSBOT, field=None)])
def test_nothing_is_steady_behind_a_field_or_while_the_speed_rises(profile):
    governor = Governor(profile)
    for command in (Command(STOP, 0.0), Command(GO, 0.0)):
        governor.submit(command, 0.0)
        governor.tick(0.0)
    assert governor.steady_until(0.0) == 0.0


def test_silence_after_a_neutral_command_wants_a_neutral_command_again():
    desk = Desk().armed()
    assert desk.at(10.0, policy(GO, 10.0)).reason is Reason.NEUTRAL_FIRST


def test_a_long_gap_counts_as_silence_even_without_a_tick_in_it():
    desk = Desk().armed()
    desk.at(0.1, policy(GO, 0.1))
    assert desk.at(0.1 + POLICY_S + GRACE_S, policy(GO, 0.1 + POLICY_S + GRACE_S)).reason is Reason.NEUTRAL_FIRST


def test_a_stream_at_exactly_the_time_out_is_not_cut_by_rounding():
    desk = Desk().armed(0.0, T)
    for step in range(1, 50):
        now_s = step * TELEOP_S
        assert desk.at(now_s, teleop(GO, now_s)).twist == GO


@pytest.mark.parametrize(("linear", "angular", "clamps"), [
    (9.0, 0.5, ("linear",)),
    (-9.0, 0.5, ("linear",)),
    (0.5, 9.0, ("angular",)),
    (1e308, -1e308, ("linear", "angular")),
    (0.5, 0.5, ()),
])  # fmt: skip
def test_limits_and_their_names(linear, angular, clamps):
    applied = Desk().armed().at(0.1, policy(Twist(linear, angular), 0.1))
    assert applied.clamps == clamps
    assert abs(applied.twist.linear_m_s) <= PROFILE.base.max_linear_m_s
    assert abs(applied.twist.angular_rad_s) <= PROFILE.base.max_angular_rad_s
    assert math.copysign(1.0, applied.twist.linear_m_s) == math.copysign(1.0, linear)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["linear_m_s", "angular_rad_s"])
def test_non_finite_stops_until_neutral(bad, field):
    desk = Desk().armed()
    desk.at(0.1, policy(GO, 0.1))
    values = {"linear_m_s": 0.0, "angular_rad_s": 0.0} | {field: bad}
    applied = desk.at(0.15, policy(Twist(**values), 0.15))
    assert (applied.twist, applied.reason) == (STOP, Reason.REFUSED)
    assert desk.governor.refused == {"not finite": 1}
    assert desk.at(0.2, policy(GO, 0.2)).reason is Reason.NEUTRAL_FIRST


def test_a_broken_policy_does_not_stop_a_person():
    desk = Desk().armed(0.0, T)
    assert desk.at(0.1, teleop(GO, 0.1), policy(Twist(math.nan, 0.0), 0.1)).twist == GO


def test_a_broken_hand_stops_policy_too():
    desk = Desk().armed()
    applied = desk.at(0.1, policy(GO, 0.1), teleop(Twist(math.nan, 0.0), 0.1))
    assert (applied.twist, applied.reason) == (STOP, Reason.REFUSED)


@pytest.mark.parametrize(("stamp_s", "why"), [
    (10.0 - POLICY_S, "late"),
    (9.9, "out of order"),
    (10.0 + 0.11, "from the future"),
    (10.0 + 3600.0, "from the future"),
    (math.nan, "no time"),
    (math.inf, "no time"),
])  # fmt: skip
def test_late_replayed_and_future_commands_are_refused_and_counted(stamp_s, why):
    desk = Desk().armed(9.7 if why == "late" else 9.8)
    if why != "late":
        desk.at(9.95, policy(TURN, 9.95))
    applied = desk.at(10.0, policy(GO, stamp_s))
    assert applied.twist == (STOP if why == "late" else TURN)
    assert desk.governor.refused == {why: 1}


def test_a_command_without_a_source_is_refused():
    desk = Desk().armed()
    assert desk.at(0.1, Command(GO, 0.1, Source.NONE)).twist == STOP
    assert desk.governor.refused == {"no source": 1}


def test_a_stamp_ahead_of_the_clock_does_not_stretch_the_time_out():
    desk = Desk().armed()
    assert desk.at(0.1, policy(GO, 0.1 + 0.099)).twist == GO
    assert desk.at(0.1 + POLICY_S).reason is Reason.STALE


def test_a_clock_that_runs_ahead_puts_nobody_else_out_of_order():
    desk = Desk()
    desk.at(0.0, by(1, STOP, 0.0))
    assert desk.at(0.1, by(1, GO, 0.19)).twist == GO
    assert desk.at(0.12, by(1, TURN, 0.18)).twist == GO  # its own are in its own order
    desk.at(0.13, by(1, STOP, 0.21, released=True))
    assert desk.at(0.14, by(2, STOP, 0.14)).reason is Reason.OK
    assert desk.at(0.15, by(1, TURN, 0.2)).twist == STOP
    assert desk.governor.refused == {"out of order": 1, "another commander": 1}


def test_a_zero_of_a_hand_that_has_let_go_takes_nobodys_lease():
    desk = Desk()
    desk.at(0.0, by(1, STOP, 0.0, source=T))
    silent_s = PROFILE.control.lease_s + 0.1
    desk.at(silent_s, by(2, STOP, silent_s, source=T, released=True))
    back_s = silent_s + 0.1
    assert desk.at(back_s, by(1, STOP, back_s, source=T)).reason is Reason.OK
    desk.at(back_s + 0.02, by(1, STOP, back_s + 0.02, source=T, released=True))
    assert desk.at(back_s + 0.04, by(3, GO, back_s + 0.04, source=T)).session == session_of(3)
    assert desk.governor.refused == {}


def test_what_was_commanded_before_a_stop_does_not_drive_after_it():
    desk = Desk().armed()
    desk.at(0.1, policy(GO, 0.1))
    desk.governor.note_devices((), 1)
    assert desk.at(0.12, teleop(STOP, 0.12)).reason is Reason.OK
    assert desk.at(0.14, teleop(STOP, 0.14, released=True)).twist == STOP
    assert desk.at(0.16, policy(GO, 0.16)).twist == GO


def test_what_a_policy_commanded_before_it_broke_does_not_drive_after_the_hand_that_took_over():
    desk = Desk().armed()
    desk.at(0.1, policy(GO, 0.1), teleop(TURN, 0.1), policy(Twist(math.nan, 0.0), 0.1))
    assert desk.at(0.12, teleop(STOP, 0.12, released=True)).twist == STOP


def test_a_hand_that_was_there_before_a_halt_does_not_keep_policy_from_arming_after_it():
    desk = Desk().armed(0.0, T)
    desk.at(0.1, teleop(GO, 0.1))
    desk.governor.halt()
    assert desk.at(0.12, policy(STOP, 0.12)).reason is Reason.OK
    assert desk.at(0.14, policy(GO, 0.14)).twist == GO


def test_a_take_over_and_its_end_need_no_neutral_command():
    desk = Desk().armed()
    assert desk.at(0.1, policy(GO, 0.1)).source is P
    taken = desk.at(0.15, teleop(TURN, 0.15))
    assert (taken.twist, taken.source) == (TURN, T)
    assert desk.at(0.2, policy(GO, 0.2)).twist == TURN
    back = desk.at(0.3, teleop(STOP, 0.3, released=True), policy(GO, 0.3))
    assert (back.twist, back.source) == (GO, P)


def test_a_released_hand_holds_zero_until_policy_commands():
    desk = Desk().armed(0.0, T)
    assert desk.at(0.1, teleop(GO, 0.1)).twist == GO
    assert desk.at(0.2, teleop(GO, 0.2, released=True)).twist == STOP
    assert desk.at(0.3, policy(GO, 0.3)).twist == GO


def test_after_a_release_into_silence_a_neutral_command_comes_first():
    desk = Desk().armed(0.0, T)
    desk.at(0.1, teleop(STOP, 0.1, released=True))
    assert desk.at(0.1 + TELEOP_S).reason is Reason.STALE
    assert desk.at(0.5, policy(GO, 0.5)).reason is Reason.NEUTRAL_FIRST


def test_a_hand_that_vanishes_in_motion_does_not_hand_over_to_policy():
    desk = Desk().armed()
    desk.at(0.1, policy(GO, 0.1), teleop(TURN, 0.1))
    now_s = 0.1
    while now_s < 0.1 + TELEOP_S - 0.01:
        assert desk.at(now_s, policy(GO, now_s)).twist == TURN
        now_s += 0.02
    now_s = 0.1 + TELEOP_S
    assert desk.at(now_s, policy(GO, now_s)).twist == STOP
    for _ in range(50):
        now_s += 0.02
        assert desk.at(now_s, policy(GO, now_s)).reason is Reason.NEUTRAL_FIRST
    desk.armed(now_s + 0.02)
    assert desk.at(now_s + 0.04, policy(GO, now_s + 0.04)).twist == GO


@pytest.mark.parametrize("held", [TURN, STOP])
def test_a_hand_that_vanishes_never_hands_over_to_policy_even_from_a_centred_stick(held):
    desk = Desk().armed()
    assert desk.at(0.1, teleop(held, 0.1), policy(GO, 0.1)).source is T
    assert desk.at(0.25, policy(GO, 0.25)).twist == held
    assert desk.at(0.1 + TELEOP_S, policy(GO, 0.3)).twist == STOP
    assert desk.at(0.35, policy(GO, 0.35)).reason is Reason.NEUTRAL_FIRST


def test_the_emergency_stop_holds_until_released_and_then_wants_a_new_neutral_command():
    desk = Desk().armed()
    assert desk.at(0.1, policy(GO, 0.1)).twist == GO
    desk.governor.press()
    for now_s in (0.12, 0.2, 0.3):
        let_go = teleop(STOP, now_s, released=True)
        applied = desk.at(now_s, policy(STOP, now_s), teleop(STOP, now_s), policy(GO, now_s), teleop(GO, now_s), let_go)
        assert (applied.twist, applied.reason) == (STOP, Reason.ESTOP)
    desk.governor.release(0.35)
    assert desk.at(0.36).reason is Reason.NEUTRAL_FIRST
    assert desk.at(0.37, policy(STOP, 0.34)).twist == STOP  # it was sent before the release
    assert desk.at(0.38, policy(GO, 0.38)).reason is Reason.NEUTRAL_FIRST
    assert desk.at(0.4, policy(STOP, 0.4)).reason is Reason.OK
    assert desk.at(0.42, policy(GO, 0.42)).twist == GO


def by(epoch, twist, stamp_s, *, released=False, source=P):
    return Command(twist, stamp_s, source, released=released, epoch=epoch, seq=3)


def test_a_second_commander_is_refused_and_counted():
    desk = Desk()
    desk.at(0.0, by(1, STOP, 0.0))
    assert desk.at(0.1, by(2, TURN, 0.1)).twist == STOP
    applied = desk.at(0.12, by(1, GO, 0.12))
    assert (applied.twist, applied.session, applied.seq) == (GO, session_of(1), 3)
    assert desk.at(0.15, by(2, TURN, 0.15)).twist == GO
    assert desk.governor.refused == {"another commander": 2}


def test_a_silent_commander_is_replaced_and_does_not_come_back():
    desk = Desk()
    desk.at(0.0, by(1, STOP, 0.0))
    now_s = PROFILE.control.lease_s
    assert desk.at(now_s - 0.01, by(2, STOP, now_s - 0.01)).reason is Reason.REFUSED
    assert desk.at(now_s, by(2, STOP, now_s)).reason is Reason.OK
    assert desk.at(now_s + 0.1, by(1, TURN, now_s + 0.1), by(2, GO, now_s + 0.1)).twist == GO
    desk.at(now_s + 9.0, by(1, STOP, now_s + 9.0))
    assert desk.governor.refused == {"another commander": 1, "old epoch": 2}


def test_a_commander_that_leaves_disarms_and_makes_room_at_once():
    desk = Desk()
    desk.at(0.0, by(1, STOP, 0.0))
    assert desk.at(0.1, by(1, GO, 0.1)).twist == GO
    left = desk.at(0.15, by(1, STOP, 0.15, released=True))
    assert (left.twist, left.reason, desk.governor.state) == (STOP, Reason.NO_COMMAND, State.DISARMED)
    assert desk.at(0.16, by(2, GO, 0.16)).reason is Reason.NEUTRAL_FIRST
    assert desk.at(0.17, by(2, STOP, 0.17)).reason is Reason.OK
    # It may come back, too: it let go, nobody took control from it.
    desk.at(0.2, by(2, STOP, 0.2, released=True))
    assert desk.at(0.25, by(1, STOP, 0.25)).reason is Reason.OK


def test_a_policy_that_leaves_does_not_touch_the_persons_hand():
    desk = Desk().armed()
    assert desk.at(0.1, teleop(TURN, 0.1)).twist == TURN
    desk.at(0.12, Command(STOP, 0.12, P, released=True))
    assert desk.at(0.13).twist == TURN


def with_base(**changes):
    return msgspec.structs.replace(PROFILE, base=msgspec.structs.replace(PROFILE.base, **changes))


def test_speeding_up_is_limited_and_slowing_down_is_not():
    governor = Governor(with_base(max_acceleration_m_s2=1.0))
    desk = Desk()
    desk.governor = governor
    desk.armed()
    speeds = []
    for step in range(1, 30):
        now_s = step * 0.02
        speeds.append(desk.at(now_s, policy(GO, now_s)).twist.linear_m_s)
    assert speeds[0] == pytest.approx(0.02)
    assert speeds[10] == pytest.approx(0.22)
    assert speeds[-1] == 0.5
    slow = desk.at(0.6, policy(Twist(0.1, 1.0), 0.6))
    assert (slow.twist, slow.clamps) == (Twist(0.1, 1.0), ())
    back = desk.at(0.62, policy(Twist(-0.5, 0.0), 0.62))
    assert back.twist.linear_m_s == pytest.approx(-0.02)
    assert back.clamps == ("acceleration",)
    assert desk.at(2.0).twist == STOP


def test_after_a_stall_the_speed_still_rises_step_by_step():
    desk = Desk()
    desk.governor = Governor(with_base(max_acceleration_m_s2=1.0))
    desk.armed()
    assert desk.at(0.2, policy(GO, 0.2)).twist.linear_m_s <= 0.05 + 1e-9
    assert desk.at(0.44, policy(GO, 0.44)).twist.linear_m_s == pytest.approx(0.1)


def test_policy_cannot_arm_what_a_hand_keeps_in_motion():
    desk = Desk()
    assert desk.at(0.0, teleop(GO, 0.0), policy(STOP, 0.0)).reason is Reason.NEUTRAL_FIRST


def test_every_silence_ends_within_the_stop_budget():
    for command, timeout_s in ((policy(GO, 0.1), POLICY_S), (teleop(GO, 0.1), TELEOP_S)):
        desk = Desk().armed(0.0, command.source)
        assert desk.at(0.1, command).twist == GO
        assert timeout_s + GRACE_S < STOP_BUDGET_S
        assert desk.at(0.1 + timeout_s).twist == STOP


NUMBERS = st.one_of(st.sampled_from([0.0, 0.5, -0.5, math.nan, math.inf, 1e308, 1e-7]), st.floats(-3.0, 3.0))
ACTIONS = st.lists(
    st.tuples(
        st.sampled_from([0.0, 0.02, 0.05, 0.15, 0.2, 0.25, 1.0]),  # time that passes first
        st.one_of(
            st.none(),
            st.builds(
                Command,
                st.one_of(st.just(STOP), st.builds(Twist, NUMBERS, NUMBERS)),
                st.sampled_from([0.0, 0.0, 0.0, -0.1, -0.3, 0.05, 1.0, math.nan]),  # stamp relative to now
                st.sampled_from(Source),
                st.integers(-1, 9),
                st.sampled_from([False, False, False, True]),
                st.sampled_from([1, 1, 1, 2]),
            ),
            st.sampled_from(["press", "release", "halt"]),
        ),
    ),
    max_size=40,
)


@settings(max_examples=300, deadline=None)
@given(ACTIONS)
def test_no_sequence_of_events_breaks_a_promise(actions):
    governor = Governor(PROFILE)
    now_s = 100.0
    newest_s = {P: -math.inf, T: -math.inf}  # the newest finite command that may be obeyed
    neutral_since_stop = pressed = False
    commanded_s: dict[tuple[Source, int], float] = {}
    for passed_s, wish in actions:
        now_s += passed_s
        if wish == "press":
            governor.press()
            pressed = True
        elif wish == "release":
            governor.release(now_s)
            pressed = False
        elif wish == "halt":
            governor.halt()
        elif wish is not None:
            stamp_s = now_s + wish.stamp_s
            governor.submit(replace(wish, stamp_s=stamp_s), now_s)
            if wish.source in newest_s and math.isfinite(stamp_s):
                newest_s[wish.source] = max(newest_s[wish.source], min(stamp_s, now_s))
                commanded_s[wish.source, session_of(wish.epoch)] = now_s
            neutral_since_stop |= is_neutral(wish.twist) or wish.released
        applied = governor.tick(now_s)
        moving = not is_neutral(applied.twist)
        assert abs(applied.twist.linear_m_s) <= PROFILE.base.max_linear_m_s
        assert abs(applied.twist.angular_rad_s) <= PROFILE.base.max_angular_rad_s
        assert (governor.state is State.EMERGENCY) is pressed
        if governor.state is not State.ARMED:
            neutral_since_stop = False
            assert not moving
            assert applied.reason is not Reason.OK
        if moving:
            assert neutral_since_stop
            assert applied.reason is Reason.OK
            timeout_s = POLICY_S if applied.source is P else TELEOP_S
            assert 0.0 <= applied.command_age_s < timeout_s
            assert newest_s[applied.source] > now_s - timeout_s
            # Whose command it is, commanded lately.
            assert commanded_s[applied.source, applied.session] > now_s - timeout_s
