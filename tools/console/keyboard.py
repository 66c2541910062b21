"""The keyboard as a pad, for who has none: SPACE is the dead-man, arrows the stick, letters and digits ask. Pure.

It drives the same `Hand` as a pad, so it locks, gives back and stops in the same way.
"""

from collections.abc import Set

from lira.tools.joystick.axes import PadState
from lira.tools.joystick.pads.codes import AXES, BUTTONS
from lira.tools.joystick.pads.mapping import Mapping, load_mapping

KEYS = {
    "space": "BTN_TL",
    "left shift": "BTN_TR",
    "escape": "BTN_MODE",
    "f1": "BTN_START",
    "p": "BTN_WEST",
    "s": "BTN_NORTH",
    "r": "BTN_EAST",
    "v": "BTN_SOUTH",
    "u": "BTN_THUMBL",
    "1": "BTN_DPAD_UP",
    "2": "BTN_DPAD_RIGHT",
    "3": "BTN_DPAD_DOWN",
    "4": "BTN_DPAD_LEFT",
}
REST, LOW, HIGH = 128, 0, 255


def keyboard_mapping() -> Mapping:
    """The mapping that the keys below are named for."""
    return load_mapping("ps3")


def pad_of(pressed: Set[str]) -> PadState:
    """The pad that these keys stand for; opposite arrows cancel."""
    buttons = frozenset(BUTTONS[name] for key, name in KEYS.items() if key in pressed)
    axes = {AXES["ABS_Y"]: _between(pressed, "up", "down"), AXES["ABS_X"]: _between(pressed, "left", "right")}
    return PadState({}, axes, buttons)


def _between(pressed: Set[str], low: str, high: str) -> int:
    if (low in pressed) == (high in pressed):
        return REST
    return LOW if low in pressed else HIGH
