"""Real pads by the controls that the kernel says they have, and the layout that is taken for each."""

import re
from pathlib import Path

import pytest

from lira.tools.cli import main
from lira.tools.joystick.axes import AxisRange, PadState
from lira.tools.joystick.device.rules import rules_text
from lira.tools.joystick.pads.codes import AXES, BUTTONS
from lira.tools.joystick.pads.families import FAMILIES, layout_of, missing, why_not
from lira.tools.joystick.pads.mapping import known_pads, load_mapping
from lira.tools.joystick.pads.nodes import Node, is_any_pad

HAT = {16, 17}
PLACED = {304, 305, 307, 308, 310, 311, 314, 315, 316, 317, 318}
SHOULDERS = {312, 313}
DPAD = set(range(544, 548))
STICKS = {0, 1, 2, 3, 4, 5}
NUMBERED, COUNTED = set(range(304, 317)), set(range(288, 300))


def pad(vendor, buttons, axes, name="pad"):
    return Node("/dev/input/event5", name, vendor, "0001", "", frozenset(buttons), frozenset(axes), False)


SONY_HID = "DualShock 4, DualSense without driver"
PADS = {
    "DualShock 3": (pad("054c", PLACED | SHOULDERS | DPAD, STICKS), "PS3"),
    "DualShock 4": (pad("054c", PLACED | SHOULDERS, STICKS | HAT), "DualShock 4, DualSense"),
    "DualSense, hid-generic": (
        pad("054c", NUMBERED | {317, 318}, STICKS | HAT),
        SONY_HID,
    ),
    "Xbox 360, xpad": (pad("045e", PLACED, STICKS | HAT), "Xbox"),
    "Xbox Series by radio": (pad("045e", PLACED | {167}, {0, 1, 2, 5, 9, 10} | HAT), "Xbox"),
    "F710 in X mode": (pad("046d", PLACED, STICKS | HAT), "Xbox"),
    "F710 in D mode": (pad("046d", COUNTED, {0, 1, 2, 5} | HAT), "Logitech in D mode"),
    "Switch Pro": (pad("057e", PLACED | SHOULDERS | {309}, {0, 1, 3, 4} | HAT), "Switch Pro"),
    "8BitDo in D mode": (pad("2dc8", NUMBERED | {317, 318}, {0, 1, 2, 5, 9, 10} | HAT), "8BitDo in D mode"),
    "8BitDo in X mode": (pad("2dc8", PLACED, STICKS | HAT), "Xbox"),
    "DragonRise": (pad("0079", set(range(288, 298)), {0, 1}), "USB gamepad"),
    "PDP for Switch": (pad("0e6f", NUMBERED, {0, 1, 2, 5} | HAT), None),
    "Hori": (pad("0f0d", NUMBERED, {0, 1, 2, 5} | HAT), None),
    "an unknown joystick": (pad("1234", COUNTED, {0, 1, 2, 5} | HAT), None),
    "a flight stick": (pad("044f", set(range(288, 304)), {0, 1, 5, 6} | HAT), None),
    "a touchpad": (pad("06cb", {272, *range(320, 336)}, {0, 1, 24, 53, 54}), None),
    "a tablet": (pad("056a", {*range(256, 260), *range(320, 333)}, {0, 1, 24}), None),
    "a keyboard": (pad("1234", set(range(1, 248)), set()), None),
    "a pad without shoulders": (pad("054c", PLACED - {310}, STICKS | HAT), None),
}


@pytest.mark.parametrize("name", PADS)
def test_each_pad_gets_its_layout_or_is_asked_about(name):
    node, layout = PADS[name]
    mapping = layout_of(node)
    assert (None if mapping is None else mapping.name) == layout
    if layout is None:
        assert str(node) in why_not(node)
        assert is_any_pad(node) == (name not in ("a touchpad", "a tablet", "a keyboard"))
    else:
        asked = [name for name in (mapping.pause, mapping.save, mapping.reset, *mapping.experts) if name]
        there = {name for name, code in BUTTONS.items() if code in node.buttons}
        there |= {f"{name}{sign}" for name, code in AXES.items() if code in node.axes for sign in "+-"}
        assert set(asked) <= there
        assert len(mapping.experts) == (0 if layout == "USB gamepad" else 4)


def test_what_a_pad_lacks_is_named():
    node = PADS["DragonRise"][0]
    assert missing(node, load_mapping("ps3")) == [
        "BTN_TL", "BTN_TR", "BTN_SELECT", "BTN_START", "BTN_MODE",
    ]  # fmt: skip
    assert "lacks BTN_TL, BTN_TR" in why_not(node, load_mapping("ps3"))


def test_every_layout_that_comes_along_is_in_the_table():
    assert {row.layout for row in FAMILIES} - {""} == set(known_pads())


def test_a_hat_and_a_trigger_serve_as_buttons():
    ranges = {16: AxisRange(-1, 1), 17: AxisRange(-1, 1), 5: AxisRange(0, 1023)}
    rest = PadState(ranges, {16: 0, 17: 0, 5: 0})
    ends = ("ABS_HAT0X-", "ABS_HAT0X+", "ABS_HAT0Y-", "ABS_HAT0Y+", "ABS_RZ+")
    assert not any(rest.holds(end) for end in ends)
    up_and_pulled = PadState(ranges, {16: 0, 17: -1, 5: 900})
    assert [end for end in ends if up_and_pulled.holds(end)] == ["ABS_HAT0Y-", "ABS_RZ+"]
    assert not PadState().holds("ABS_RZ+")  # it has said nothing yet


def test_the_rule_is_printed_whole_and_ships(capsys):
    assert main(["joystick", "--rules"]) == 0
    printed = capsys.readouterr().out
    assert printed == rules_text()
    lines = [line for line in printed.splitlines() if line and not line.startswith("#")]
    assert all(
        re.fullmatch(r'[A-Z]\S*[!=+]=?"[^"]*"(, \S+[!=+]?="[^"]*")*|LABEL="lira_pad_end"', line) for line in lines
    )
    for what in ("ID_INPUT_JOYSTICK", "ID_INPUT_ACCELEROMETER"):
        assert any(what in line and "uaccess" in line and 'GROUP="input"' in line for line in lines)
    for row in FAMILIES:
        for vendor in row.vendors & {"054c", "057e", "2dc8"}:
            assert vendor in printed
    text = (Path(__file__).parents[3] / "pyproject.toml").read_text()
    assert '"*.rules"' in text
