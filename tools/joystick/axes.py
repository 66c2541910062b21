"""From raw controls to an action: ranges, dead zone, expo. Pure."""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

from lira.hal.messages import Action
from lira.tools.joystick.pads.codes import AXES, BUTTONS, EV_ABS, EV_KEY, HALF, axis_of
from lira.tools.joystick.pads.mapping import Axis, Mapping


class PadEvent(NamedTuple):
    """One event of a pad: the kernel's type, code and value."""

    kind: int
    code: int
    value: int


@dataclass(frozen=True, slots=True)
class AxisRange:
    """What an axis can read."""

    minimum: int = 0
    maximum: int = 255

    def normalise(self, value: int) -> float:
        """Map to [-1, 1]; a range without extent is at rest."""
        if self.maximum <= self.minimum:
            return 0.0
        share = (value - self.minimum) / (self.maximum - self.minimum)
        return min(1.0, max(-1.0, 2.0 * share - 1.0))


@dataclass(frozen=True, slots=True)
class PadState:
    """What a pad's controls are now: pressed buttons and raw axes by code."""

    ranges: dict[int, AxisRange] = field(default_factory=dict)
    axes: dict[int, int] = field(default_factory=dict)
    pressed: frozenset[int] = frozenset()

    def after(self, event: PadEvent) -> "PadState":
        """The state after an event; events that are no control change nothing."""
        if event.kind == EV_ABS:
            return replace(self, axes={**self.axes, event.code: event.value})
        if event.kind == EV_KEY:
            code = frozenset((event.code,))
            return replace(self, pressed=self.pressed | code if event.value else self.pressed - code)
        return self

    def holds(self, control: str) -> bool:
        """Whether a button is pressed, or an axis that serves as one (`codes.axis_of`) at that end."""
        axis = axis_of(control)
        if axis is None:
            return BUTTONS[control] in self.pressed
        return self.reads(axis) >= HALF if control.endswith("+") else self.reads(axis) <= -HALF

    def reads(self, axis: str) -> float:
        """An axis in [-1, 1]; 0 if it has said nothing."""
        code = AXES[axis]
        if code not in self.axes:
            return 0.0
        return self.ranges.get(code, AxisRange()).normalise(self.axes[code])


def shape(value: float, dead_zone: float, expo: float) -> float:
    """Cut the dead zone out of [-1, 1], stretch the rest to it, and bend it: (1 - expo) x + expo x^3."""
    way = abs(value)
    if way <= dead_zone:
        return 0.0
    x = (way - dead_zone) / (1.0 - dead_zone)
    bent = (1.0 - expo) * x + expo * x**3
    return bent if value > 0.0 else -bent


def action_of(pad: PadState, mapping: Mapping) -> Action:
    """What the sticks ask for, each in [-1, 1]; without turbo up to the mapping's `cruise`."""
    scale = 1.0 if pad.holds(mapping.turbo) else mapping.cruise
    return scale * _shaped(pad, mapping.forward, mapping), scale * _shaped(pad, mapping.turn, mapping)


def unrest(pad: PadState, mapping: Mapping) -> list[str]:
    """What keeps a pad from being at rest: which axis reads what, and whether the dead-man is held."""
    found = [
        f"{axis.axis} reads {pad.reads(axis.axis):+.2f} (dead zone {mapping.dead_zone:.2f})"
        for axis in (mapping.forward, mapping.turn)
        if abs(pad.reads(axis.axis)) > mapping.dead_zone
    ]
    return found + ([f"{mapping.dead_man} is held"] if pad.holds(mapping.dead_man) else [])


def _shaped(pad: PadState, axis: Axis, mapping: Mapping) -> float:
    value = shape(pad.reads(axis.axis), mapping.dead_zone, mapping.expo)
    return -value if axis.inverted else value
