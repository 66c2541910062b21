"""Buttons that ask: once for each press, reset only when held, nothing from a pad that comes with one pressed."""

import itertools

import pytest

from lira.hal.messages import OperatorRequest, Request
from lira.tools.console.keyboard import pad_of
from lira.tools.joystick.axes import PadState
from lira.tools.joystick.freeze import GAPS, FreezeWatch
from lira.tools.joystick.known_pads import PadMemory, state_file
from lira.tools.joystick.pads.codes import BUTTONS
from lira.tools.joystick.pads.mapping import load_mapping
from lira.tools.joystick.requests import HOLD_S, RequestButtons

PS3 = load_mapping("ps3")
EXPERTS = ("camera", "lidar")
REST = PadState()


def pad(*names):
    return PadState(pressed=frozenset(BUTTONS[name] for name in names))


def asked(states, *, paused=False, step_s=0.1):
    """What a pad asks that shows these states, one each `step_s`."""
    buttons = RequestButtons(PS3)
    return [
        buttons.update(state, step_s * k, paused=paused, experts=EXPERTS) for k, state in enumerate(states)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("button", "paused", "request_"),
    [
        ("BTN_WEST", False, OperatorRequest(Request.PAUSE)),
        ("BTN_WEST", True, OperatorRequest(Request.RESUME)),
        ("BTN_NORTH", False, OperatorRequest(Request.SAVE)),
        ("BTN_DPAD_UP", False, OperatorRequest(Request.HANDOVER, "camera")),
        ("BTN_DPAD_RIGHT", False, OperatorRequest(Request.HANDOVER, "lidar")),
        ("BTN_DPAD_DOWN", False, OperatorRequest(Request.HANDOVER, "expert 3")),
    ],
)
def test_a_press_asks_once_at_once(button, paused, request_):
    assert asked([REST, pad(button), pad(button), REST, pad(button)], paused=paused) == [
        [], [request_], [], [], [request_],
    ]  # fmt: skip


def test_reset_asks_once_when_it_has_been_held():
    steps = round(HOLD_S / 0.1)
    held = asked([REST, *[pad("BTN_EAST")] * (steps + 10), REST, pad("BTN_EAST")])
    assert [k for k, requests in enumerate(held) if requests] == [1 + steps]
    assert held[1 + steps] == [OperatorRequest(Request.RESET)]


def test_a_button_that_is_pressed_while_the_pad_comes_asks_nothing_until_it_was_let_go():
    held = pad("BTN_WEST", "BTN_EAST")
    lost_and_back = [held] * 30 + [None] + [held] * 30
    assert not any(asked(lost_and_back))
    assert asked([*lost_and_back, REST, held])[-1] == [OperatorRequest(Request.PAUSE)]


def test_no_other_button_asks():
    others = set(PS3.buttons) - {*PS3.asking, *PS3.experts}
    assert not any(itertools.chain(*asked([REST, pad(*others), REST])))


def test_the_keys_ask_the_same():
    for key, button in (("p", "BTN_WEST"), ("s", "BTN_NORTH"), ("r", "BTN_EAST"), ("1", "BTN_DPAD_UP")):
        assert pad_of({key}).holds(button)
        assert not pad_of(set()).holds(button)


def test_a_pad_is_remembered_over_sessions(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    said = []
    memory = PadMemory(state_file(), said.append)
    assert memory.timeout_s("054c/0268/pad/1") is None
    memory.keep("054c/0268/pad/1", 0.2)
    memory.keep("054c/0268/pad/2", 0.15)
    again = PadMemory(state_file(), said.append)
    assert (again.timeout_s("054c/0268/pad/1"), again.timeout_s("054c/0268/pad/2")) == (0.2, 0.15)
    assert [path.name for path in (tmp_path / "lira").iterdir()] == ["pads.json"]
    assert said == []


@pytest.mark.parametrize("text", ["", "{", "[]", '{"pad": {"timeout_s": 99.0}}', '{"pad": {"timeout_s": "x"}}', "\xff"])
def test_a_memory_that_is_not_understood_is_said_and_written_anew(tmp_path, text):
    path, said = tmp_path / "pads.json", []
    path.write_text(text, encoding="latin-1")
    memory = PadMemory(path, said.append)
    assert memory.timeout_s("pad") is None
    assert "is kept as" in said[0]
    memory.keep("pad", 0.2)
    assert PadMemory(path).timeout_s("pad") == 0.2


def test_a_place_that_cannot_be_written_is_said_once(tmp_path):
    (tmp_path / "file").write_text("")
    said = []
    memory = PadMemory(tmp_path / "file" / "pads.json", said.append)
    for timeout_s in (0.2, 0.3):
        memory.keep("pad", timeout_s)
        assert memory.timeout_s("pad") == timeout_s
    assert len(said) == 1


def test_a_time_out_that_was_learned_earlier_holds_from_the_first_event_until_a_freeze():
    watch = FreezeWatch(0.2)
    assert not watch.is_alive(0.0)
    watch.note(0.0)
    assert watch.is_alive(0.199)
    assert not watch.is_alive(0.201)
    watch.note(3.0)
    assert not watch.is_alive(3.0)  # it was frozen: now it has to prove itself anew
    for k in range(GAPS):
        watch.note(3.0 + 0.01 * (k + 1))
    assert watch.is_alive(3.0 + 0.01 * GAPS)
    assert watch.learned_s == watch.timeout_s == pytest.approx(0.1)


def test_prove_is_asked_at_once_and_undo_when_held():
    cross, thumb = pad(PS3.prove), pad(PS3.undo)
    assert [request.request for request in itertools.chain(*asked([REST, cross, REST]))] == [Request.PROVE]
    assert not any(itertools.chain(*asked([REST, thumb, REST])))
