"""Which input node is a pad, from what the kernel says about every node in /sys: readable even where /dev is not."""

import os
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lira.hal.errors import DeviceError
from lira.tools.joystick.codes import INPUT_PROP_ACCELEROMETER
from lira.tools.joystick.mapping import Mapping

SYS_INPUT = Path("/sys/class/input")
WORD_BITS = 8 * struct.calcsize("l")
BUTTONS_FROM = 288  # BTN_JOYSTICK: below it are keyboards and mice


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

    @property
    def identity(self) -> tuple[str, str, str, str]:
        """Vendor, product, name and, where the pad has one, its own address."""
        return self.vendor, self.product, self.name, self.uniq

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

    return Node(
        path=f"/dev/input/{entry.name}",
        name=text("name"),
        vendor=text("id/vendor"),
        product=text("id/product"),
        uniq=text("uniq"),
        buttons=parse_bitmap(text("capabilities/key")),
        axes=parse_bitmap(text("capabilities/abs")),
        is_motion=INPUT_PROP_ACCELEROMETER in parse_bitmap(text("properties")),
    )


def fits(node: Node, mapping: Mapping) -> bool:
    """Whether a node has every control of the mapping. A pad's motion sensors are a node without buttons."""
    return not node.is_motion and mapping.needed_buttons <= node.buttons and mapping.needed_axes <= node.axes


def is_any_pad(node: Node) -> bool:
    """Whether a node could be a pad of whatever layout: two axes and some buttons that are not a keyboard's."""
    return not node.is_motion and len(node.axes) >= 2 and len([b for b in node.buttons if b >= BUTTONS_FROM]) >= 4


def motion_of(pad: Node, nodes: Sequence[Node]) -> Node | None:
    """The node with the motion sensors of this pad."""
    for node in nodes:
        if node.is_motion and (node.vendor, node.product, node.uniq) == (pad.vendor, pad.product, pad.uniq):
            return node
    return None


def choose(nodes: Sequence[Node], mapping: Mapping, device: str | None = None) -> Node | None:
    """The pad to use: `device` if given (links are followed), else the first that fits; None if none is there.

    Raises `DeviceError` if `device` is there and is no such pad.
    """
    if device is None:
        return next((node for node in nodes if fits(node, mapping)), None)
    real = os.path.realpath(device)
    node = next((node for node in nodes if real == os.path.realpath(node.path)), None)
    if node is not None and not fits(node, mapping):
        raise DeviceError(
            f"{node} does not have the controls of the pad '{mapping.name}'",
            "Choose another --device, or write a mapping for it: lira joystick --learn my-pad.toml",
        )
    return node
