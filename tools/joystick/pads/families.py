"""Which layout a pad has: a table that its name, maker and controls choose. Pure.

Kernel drivers give buttons codes by their place (hid-playstation, hid-nintendo) or by their letter (xpad). Without a
driver they are numbered as the maker did, and a code says nothing of its place: BTN_C and BTN_Z together, which no pad
of today has, are the sign of that. Such a pad is taken only if its maker numbers all alike, else the person is asked.
"""

from dataclasses import dataclass, field

from lira.tools.joystick.pads.codes import AXES, BUTTONS, control_names
from lira.tools.joystick.pads.mapping import Mapping, load_mapping
from lira.tools.joystick.pads.nodes import Node, is_any_pad

SONY, EIGHTBITDO, LOGITECH = "054c", "2dc8", "046d"
CHEAP = frozenset(("0079", "0810", "0e8f", "12bd"))  # DragonRise, Personal Communication Systems, GreenAsia, and such


@dataclass(frozen=True, slots=True)
class Family:
    """A row: pads with these controls and not those, of these makers (none: any), have this layout ("": ask)."""

    layout: str
    has: tuple[str, ...]
    lacks: tuple[str, ...] = ()
    vendors: frozenset[str] = field(default_factory=frozenset)

    def takes(self, node: Node) -> bool:
        """Whether a pad is one of these."""
        there = node.buttons | {-1 - code for code in node.axes}  # one set of numbers for both
        return (
            (not self.vendors or node.vendor in self.vendors)
            and all(_number(name) in there for name in self.has)
            and not any(_number(name) in there for name in self.lacks)
        )


HAT = ("ABS_HAT0X", "ABS_HAT0Y")
NUMBERED = ("BTN_C", "BTN_Z")  # by the maker, from BTN_SOUTH on
COUNTED = ("BTN_0x120", "BTN_0x129")  # likewise, from BTN_TRIGGER on
FAMILIES = (
    Family("sony-hid", (*NUMBERED, *HAT), vendors=frozenset((SONY,))),
    Family("8bitdo-hid", (*NUMBERED, *HAT), vendors=frozenset((EIGHTBITDO,))),
    Family("", NUMBERED),
    Family("ps3", ("BTN_SOUTH", "BTN_DPAD_UP", "BTN_TL2", "BTN_MODE")),
    Family("dualshock", ("BTN_SOUTH", "BTN_TL2", "BTN_MODE", *HAT), vendors=frozenset((SONY,))),
    Family("switch-pro", ("BTN_SOUTH", "BTN_TL2", "BTN_MODE", *HAT)),
    Family("xbox", ("BTN_SOUTH", "BTN_NORTH", "BTN_MODE", *HAT), ("BTN_TL2",)),
    Family("logitech-d", (*COUNTED, *HAT), vendors=frozenset((LOGITECH,))),
    Family("usb-gamepad", COUNTED, vendors=CHEAP),
)


def layout_of(node: Node) -> Mapping | None:
    """The layout of a pad; None if that is not known, or something of it is missing."""
    if node.is_motion:
        return None
    row = next((row for row in FAMILIES if row.takes(node)), None)
    if row is None or not row.layout:
        return None
    mapping = load_mapping(row.layout)
    return None if missing(node, mapping) else mapping


def missing(node: Node, mapping: Mapping) -> list[str]:
    """Controls that one cannot drive without, and this pad has not."""
    return [*control_names(mapping.needed_buttons - node.buttons, mapping.needed_axes - node.axes)]


def why_not(node: Node, mapping: Mapping | None = None) -> str:
    """Say why a pad is not used: what it lacks, or that nobody knows which button is where."""
    if mapping is not None and (lacks := missing(node, mapping)):
        return f"{node} lacks {', '.join(lacks)} of the layout '{mapping.name}'"
    if any(row.takes(node) and not row.layout for row in FAMILIES):
        return f"{node} numbers its buttons as its maker likes: nobody can tell which is where"
    if not is_any_pad(node):
        return f"{node} is no gamepad"
    return f"{node} has a layout that is not known"


def _number(name: str) -> int:
    return BUTTONS[name] if name in BUTTONS else -1 - AXES[name]
