"""Writing the file of a pad by watching which control moves. Pure."""

from dataclasses import dataclass

from lira.tools.joystick.axes import PadState
from lira.tools.joystick.pads.codes import AXES, AXIS_NAMES, BUTTON_NAMES, BUTTONS, HALF
from lira.tools.joystick.pads.mapping import Axis

EXPERTS = "experts"
MOVED = 0.7  # share of an axis's way from where it rested


@dataclass(frozen=True, slots=True)
class Ask:
    """One question: the key it fills, what to say, whether an axis answers it, and whether it may go unanswered."""

    key: str
    words: str
    is_axis: bool = False
    optional: bool = False


ASKS = (
    Ask("forward", "push the stick that drives all the way FORWARD, hold it", is_axis=True),
    Ask("turn", "push the stick that turns all the way LEFT, hold it", is_axis=True),
    Ask("dead_man", "press the DEAD-MAN (a shoulder button: you drive while you hold it)"),
    Ask("turbo", "press TURBO (another shoulder button)"),
    Ask("estop", "press the EMERGENCY STOP (one that you find without looking)"),
    Ask("release", "press the button that RELEASES the emergency stop when held"),
    Ask("pause", "press the button that PAUSES driving and learning, or wait to do without", optional=True),
    Ask("save", "press the button that SAVES what was learned, or wait to do without", optional=True),
    Ask("reset", "press the button that begins a new EPISODE when held, or wait to do without", optional=True),
    Ask("prove", "press the button for the PROOF of a session of teaching, or wait to do without", optional=True),
    Ask("undo", "press the button that UNDOES the last intervention when held, or wait to do without", optional=True),
    *(
        Ask(
            f"experts{number}",
            f"press the button that gives control to EXPERT {number}, or wait to do without",
            optional=True,
        )
        for number in range(1, 5)
    ),
)


def moved_axis(rest: PadState, now: PadState) -> Axis | None:
    """The axis that went furthest from rest, if far enough; the robot's positive is where it was pushed."""
    ways = {name: now.reads(name) - rest.reads(name) for name, code in AXES.items() if code in now.axes}
    name = max(ways, key=lambda name: abs(ways[name]), default=None)
    if name is None or abs(ways[name]) < MOVED:
        return None
    return Axis(axis=name, inverted=ways[name] < 0.0)


def pressed_button(rest: PadState, now: PadState, driving: frozenset[str] = frozenset()) -> str | None:
    """The control that is pressed now and was not at rest: a button that has a name, or else the end of an axis.

    Not that of an axis in `driving`.
    """
    named = [BUTTON_NAMES[code] for code in sorted(now.pressed - rest.pressed) if code in BUTTON_NAMES]
    ends = [f"{axis}{sign}" for axis, code in AXES.items() if code in now.axes and axis not in driving for sign in "+-"]
    moved = [end for end in ends if now.holds(end) and not rest.holds(end) and _is_far(rest, now, end[:-1])]
    return next(iter(named + moved), None)


def _is_far(rest: PadState, now: PadState, axis: str) -> bool:
    return abs(now.reads(axis) - rest.reads(axis)) >= HALF


def to_toml(
    name: str, found: dict[str, Axis | str], axes: frozenset[int], buttons: frozenset[int], *, freeze: bool = False
) -> str:
    """The file: what was found by key, and every control in the order of its number for `joy`.

    `freeze`: the pad has motion sensors, so that a live one is never silent.
    """
    lines = [f"name = {_quoted(name)}"]
    for ask in ASKS:
        if ask.key not in found or ask.key.startswith(EXPERTS):
            continue
        value = found[ask.key]
        if isinstance(value, Axis):
            lines.append(f'{ask.key} = {{ axis = "{value.axis}", inverted = {str(value.inverted).lower()} }}')
        else:
            lines.append(f'{ask.key} = ["{value}"]' if ask.key == "estop" else f'{ask.key} = "{value}"')
    experts = [f'"{found[ask.key]}"' for ask in ASKS if ask.key.startswith(EXPERTS) and ask.key in found]
    lines.append(f"experts = [{', '.join(experts)}]")
    lines.append(f"freeze = {str(freeze).lower()}")
    lines.append(f"axes = [{_names(AXES, axes)}]")
    lines.append(f"buttons = [{_names(BUTTONS, buttons)}]")
    return "\n".join(lines) + "\n"


def _names(names: dict[str, int], codes: frozenset[int]) -> str:
    known = {**AXIS_NAMES, **BUTTON_NAMES}
    return ", ".join(f'"{known[code]}"' for code in sorted(codes & set(names.values())))


def _quoted(text: str) -> str:
    printable = "".join(c for c in text if c.isprintable()).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{printable}"'
