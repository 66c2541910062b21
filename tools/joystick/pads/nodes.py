"""Which input node is a pad, from what the kernel says about every node in /sys: readable even where /dev is not."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lira.tools.joystick.pads.codes import INPUT_PROP_ACCELEROMETER

SYS_INPUT = Path("/sys/class/input")
WORD_BITS = 8 * struct.calcsize("l")
# Of joysticks, gamepads, their d-pads and what they have beyond: keyboards, mice, touchpads and tablets have others.
PAD_BUTTONS = frozenset((*range(288, 320), *range(544, 548), *range(704, 744)))
FEWEST_BUTTONS = 4


@dataclass(frozen=True, slots=True)
class Node:
    """One /dev/input/event*. `identity` tells one pad from another, as far as pads tell."""

    path: str
    name: str
    vendor: str
    product: str
    uniq: str
    buttons: frozenset[int]
    axes: frozenset[int]
    is_motion: bool
    effects: frozenset[int] = frozenset()

    @property
    def identity(self) -> tuple[str, ...]:
        """Vendor, product and the pad's own address; its name if it has none: by cable it may have another."""
        return self.vendor, self.product, self.uniq.lower() or self.name

    @property
    def key(self) -> str:
        """The identity as one word, to keep things by."""
        return "/".join(self.identity)

    def __str__(self) -> str:
        return f"{self.name} ({self.path})"


def parse_bitmap(text: str, word_bits: int = WORD_BITS) -> frozenset[int]:
    """Codes of a capability bitmap in /sys: hexadecimal words, the highest first."""
    bits = 0
    for word in text.split():
        bits = bits << word_bits | int(word, 16)
    return frozenset(code for code in range(bits.bit_length()) if bits >> code & 1)


def read_nodes(folder: Path = SYS_INPUT) -> list[Node]:
    """Every input node there is now, by number. One that goes away meanwhile is left out."""
    nodes = []
    for entry in sorted(folder.glob("event*"), key=lambda entry: (len(entry.name), entry.name)):
        try:
            nodes.append(_read_node(entry))
        except (OSError, ValueError):
            continue
    return nodes


def _read_node(entry: Path) -> Node:
    def text(name: str) -> str:
        return (entry / "device" / name).read_text(encoding="utf-8", errors="replace").strip()

    effects = entry / "device" / "capabilities" / "ff"
    return Node(
        path=f"/dev/input/{entry.name}",
        name=text("name"),
        vendor=text("id/vendor"),
        product=text("id/product"),
        uniq=text("uniq"),
        buttons=parse_bitmap(text("capabilities/key")),
        axes=parse_bitmap(text("capabilities/abs")),
        is_motion=INPUT_PROP_ACCELEROMETER in parse_bitmap(text("properties")),
        effects=parse_bitmap(text("capabilities/ff")) if effects.exists() else frozenset(),
    )


def is_any_pad(node: Node) -> bool:
    """Whether a node could be a pad of whatever layout: two axes and some buttons of a pad."""
    return not node.is_motion and len(node.axes) >= 2 and len(node.buttons & PAD_BUTTONS) >= FEWEST_BUTTONS


def motion_of(pad: Node, nodes: Sequence[Node]) -> Node | None:
    """The node with the motion sensors of this pad."""
    for node in nodes:
        if node.is_motion and (node.vendor, node.product, node.uniq) == (pad.vendor, pad.product, pad.uniq):
            return node
    return None
