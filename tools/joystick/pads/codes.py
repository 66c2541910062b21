"""Names and numbers of a gamepad's controls, as in linux/input-event-codes.h and the kernel's gamepad.rst."""

from collections.abc import Iterable

EV_SYN, EV_KEY, EV_ABS = 0, 1, 3
SYN_REPORT, SYN_DROPPED = 0, 3
INPUT_PROP_ACCELEROMETER = 6

BUTTONS = {
    "BTN_SOUTH": 304,
    "BTN_EAST": 305,
    "BTN_C": 306,
    "BTN_NORTH": 307,
    "BTN_WEST": 308,
    "BTN_Z": 309,
    "BTN_TL": 310,
    "BTN_TR": 311,
    "BTN_TL2": 312,
    "BTN_TR2": 313,
    "BTN_SELECT": 314,
    "BTN_START": 315,
    "BTN_MODE": 316,
    "BTN_THUMBL": 317,
    "BTN_THUMBR": 318,
    "BTN_DPAD_UP": 544,
    "BTN_DPAD_DOWN": 545,
    "BTN_DPAD_LEFT": 546,
    "BTN_DPAD_RIGHT": 547,
    # Joysticks and pads without a gamepad driver count from here.
    **{f"BTN_{288 + n:#x}": 288 + n for n in range(16)},
    **{f"BTN_TRIGGER_HAPPY{n + 1}": 704 + n for n in range(16)},
}
AXES = {
    "ABS_X": 0,
    "ABS_Y": 1,
    "ABS_Z": 2,
    "ABS_RX": 3,
    "ABS_RY": 4,
    "ABS_RZ": 5,
    "ABS_THROTTLE": 6,
    "ABS_RUDDER": 7,
    "ABS_GAS": 9,
    "ABS_BRAKE": 10,
    "ABS_HAT0X": 16,
    "ABS_HAT0Y": 17,
}
HALF = 0.5  # of an axis's way: a hat or a trigger that goes further counts as pressed
BUTTON_NAMES = {code: name for name, code in BUTTONS.items()}
AXIS_NAMES = {code: name for name, code in AXES.items()}


def axis_of(control: str) -> str | None:
    """The axis of a control such as "ABS_HAT0Y-" or "ABS_RZ+", one end of which counts as a button; None for others."""
    return control[:-1] if control[-1:] in ("+", "-") and control[:-1] in AXES else None


def is_control(name: str) -> bool:
    """Whether there is a button, or an end of an axis, of that name."""
    return name in BUTTONS or axis_of(name) is not None


def control_names(buttons: Iterable[int], axes: Iterable[int]) -> list[str]:
    """Names of codes, in the order of their numbers."""
    return [BUTTON_NAMES[code] for code in sorted(buttons)] + [AXIS_NAMES[code] for code in sorted(axes)]
