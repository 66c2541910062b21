import itertools

import pytest

from lira.tools.joystick.axes import AxisRange, PadEvent, PadState
from lira.tools.joystick.deadman import RELEASE_S, TRANSITIONS, ZERO, ZEROS_S, Event, Hand, Order, State
from lira.tools.joystick.pads.codes import AXES, BUTTONS, EV_ABS, EV_KEY
from lira.tools.joystick.pads.mapping import load_mapping

PS3 = load_mapping("ps3")
RANGES = dict.fromkeys(range(6), AxisRange(0, 255))
REST = PadState(RANGES, {0: 128, 1: 128})


def pad(*buttons, x=128, y=128):
    return PadState(RANGES, {0: x, 1: y}, frozenset(BUTTONS[name] for name in buttons))


L1 = pad("BTN_TL")
AHEAD = pad("BTN_TL", "BTN_TR", y=0)


def ready():
    hand = Hand(PS3)
    hand.update(REST, 0.0)
    assert hand.state is State.READY
    return hand


def driving():
    hand = ready()
    assert hand.update(AHEAD, 0.1) == Order((1.0, 0.0))
    return hand


def test_the_table_knows_every_state_and_event():
    assert set(TRANSITIONS) == set(itertools.product(State, Event))


@pytest.mark.parametrize("state", State)
def test_from_every_state_a_lost_pad_and_time_end_in_silence(state):
    for first in Event:
        after = TRANSITIONS[TRANSITIONS[TRANSITIONS[state, first], Event.LOST], Event.TIME]
        after = TRANSITIONS[TRANSITIONS[after, Event.LOST], Event.TIME]
        assert after is State.LOCKED


def test_only_a_grip_drives_and_only_after_neutral():
    for (state, event), after in TRANSITIONS.items():
        if after is State.DRIVING and state is not State.DRIVING:
            assert event is Event.GRIP
            assert state in (State.READY, State.RESTING)
    assert {state for (state, event), after in TRANSITIONS.items() if after is State.READY} == {
        State.READY,
        State.LOCKED,
    }
    assert [event for (state, event), after in TRANSITIONS.items() if state is State.LOCKED and after is not state] == [
        Event.NEUTRAL
    ]


@pytest.mark.parametrize("first", [L1, AHEAD, pad(y=0), pad("BTN_TL", x=0)])
def test_a_pad_that_comes_with_something_pressed_drives_only_after_it_was_at_rest(first):
    hand = Hand(PS3)
    assert hand.update(first, 0.0) == Order(None)
    assert hand.update(AHEAD, 0.1) == Order(None)
    assert hand.update(REST, 0.2) == Order(None)
    assert hand.update(AHEAD, 0.3).action == (1.0, 0.0)


def test_without_the_dead_man_the_sticks_say_nothing():
    hand = ready()
    assert hand.update(pad("BTN_TR", y=0), 0.1) == Order(None)


def test_letting_go_sends_zeros_that_give_the_wheel_back_for_half_a_second_and_then_nothing():
    hand = driving()
    for step in range(15):
        assert hand.update(pad(y=0), 1.0 + step / 30) == Order(ZERO, released=True)
    assert hand.update(pad(y=0), 1.0 + ZEROS_S) == Order(None)
    # The stick was never at rest: neutral first.
    assert hand.update(AHEAD, 2.0) == Order(None)


def test_gripping_again_while_it_gives_back_drives_at_once():
    hand = driving()
    hand.update(REST, 1.0)
    assert hand.update(AHEAD, 1.1) == Order((1.0, 0.0))


@pytest.mark.parametrize("lost", [(None, True), (AHEAD, False)], ids=["gone", "frozen"])
def test_a_lost_pad_sends_zeros_that_keep_the_wheel_and_then_nothing(lost):
    hand = driving()
    for step in range(15):
        assert hand.update(lost[0], 1.0 + step / 30, lost[1]) == Order(ZERO, released=False)
    assert hand.update(lost[0], 1.0 + ZEROS_S, lost[1]) == Order(None)
    # It is back with the dead-man still held: neutral first.
    assert hand.update(AHEAD, 5.0) == Order(None)
    assert hand.update(REST, 5.1) == Order(None)
    assert hand.update(AHEAD, 5.2) == Order((1.0, 0.0))


def test_a_pad_lost_while_it_gives_back_goes_on_giving_back():
    hand = driving()
    hand.update(REST, 1.0)
    assert hand.update(None, 1.1) == Order(ZERO, released=True)
    assert hand.update(None, 1.6) == Order(None)
    assert hand.update(L1, 1.7) == Order(None)


@pytest.mark.parametrize("button", ["BTN_MODE", "BTN_SELECT"])
def test_the_emergency_stop_is_said_once_and_takes_the_hand_off(button):
    hand = driving()
    held = pad("BTN_TL", "BTN_TR", button, y=0)
    assert hand.update(held, 1.0) == Order(ZERO, released=False, estop=True)
    assert hand.update(held, 1.03) == Order(ZERO)
    assert hand.update(AHEAD, 3.0) == Order(None)
    assert hand.update(held, 3.1).estop is True


def test_the_emergency_stop_works_from_every_state_and_from_a_pad_that_seems_frozen():
    locked = Hand(PS3)
    locked.update(AHEAD, 0.0)
    for hand in (locked, ready(), driving()):
        assert hand.update(pad("BTN_MODE"), 1.0, False).estop is True


def test_the_ps_button_that_switches_the_pad_on_is_no_emergency_stop():
    hand = Hand(PS3)
    hand.update(None, 0.0)
    assert hand.update(pad("BTN_MODE"), 1.0).estop is None
    assert hand.update(pad("BTN_MODE"), 1.1).estop is None
    hand.update(REST, 1.2)
    assert hand.update(pad("BTN_MODE"), 1.3).estop is True


def test_start_held_releases_the_emergency_stop_once():
    hand = ready()
    start = pad("BTN_START")
    orders = [hand.update(start, 1.0 + step / 30) for step in range(90)]
    assert [order.estop for order in orders].count(False) == 1
    assert orders.index(next(order for order in orders if order.estop is False)) == pytest.approx(30 * RELEASE_S, abs=1)
    assert hand.update(REST, 5.0).estop is None
    assert hand.update(start, 6.0).estop is None
    assert hand.update(start, 7.1).estop is False


def test_a_short_start_or_one_with_the_dead_man_or_the_stop_held_releases_nothing():
    for other in ("BTN_TL", "BTN_MODE"):
        hand = ready()
        orders = [hand.update(pad("BTN_START", other), 1.0 + step / 30) for step in range(90)]
        assert all(order.estop is not False for order in orders)
    hand = ready()
    for step in range(29):
        assert hand.update(pad("BTN_START"), 1.0 + step / 30).estop is None
    assert hand.update(REST, 2.0).estop is None


def test_no_sequence_drives_without_neutral_since_the_pad_was_lost():
    inputs = [(REST, True), (AHEAD, True), (pad(y=0), True), (None, True), (AHEAD, False)]
    for sequence in itertools.product(inputs, repeat=5):
        hand, armed = Hand(PS3), False
        for step, (state, alive) in enumerate(sequence):
            armed = (armed or state is REST) and state is not None and alive
            order = hand.update(state, step * 0.6, alive)
            moves = order.action is not None and order.action != ZERO
            assert not moves or (armed and state is AHEAD)


def test_events_build_the_state():
    state = PadState(RANGES)
    for event in (PadEvent(EV_KEY, BUTTONS["BTN_TL"], 1), PadEvent(EV_ABS, AXES["ABS_Y"], 0), PadEvent(4, 4, 1)):
        state = state.after(event)
    assert state.holds("BTN_TL")
    assert state.reads("ABS_Y") == -1.0
    assert not state.after(PadEvent(EV_KEY, BUTTONS["BTN_TL"], 0)).holds("BTN_TL")
