"""Finds the pad: the first whose layout is known, and after that only the same one again."""

import os
from collections.abc import Sequence
from pathlib import Path

from lira.hal.errors import DeviceError
from lira.tools.joystick.device.pad import Pad
from lira.tools.joystick.pads.families import layout_of, missing, why_not
from lira.tools.joystick.pads.mapping import Mapping
from lira.tools.joystick.pads.nodes import Node, is_any_pad, motion_of, read_nodes

NONE_THERE = "no pad is there: plug one in, or press its PS button"
TEACH = "Teach it: lira joystick --learn my-pad.toml --device {}"


class Finder:
    """Opens the pad when it is there. Call it; raises `DeviceError`.

    `mapping` is the layout it has to have (None: whatever the table of families says), `device` the node, or a link.
    """

    def __init__(self, mapping: Mapping | None = None, device: str | None = None) -> None:
        self._mapping = mapping
        self._device = device
        self._identity: tuple[str, ...] | None = None

    def __call__(self) -> Pad | None:
        """The open pad; None while it is not there."""
        nodes = read_nodes()
        known = nodes if self._identity is None else [node for node in nodes if node.identity == self._identity]
        # A pad that is known may come back under another name: by cable, by radio.
        device = self._device if self._identity is None or not known else None
        found = choose(known, self._mapping, device)
        if found is None:
            return None
        node, mapping = found
        pad = Pad(node, mapping, motion_of(node, nodes))
        self._identity = node.identity
        return pad

    def advice(self) -> str:
        """Why there is none, in a line or two."""
        if self._device is not None:
            return f"there is no {self._device}: it is waited for"
        if self._identity is not None:
            return NONE_THERE
        others = [node for node in read_nodes() if is_any_pad(node)]
        if not others:
            return NONE_THERE
        node = others[0]
        return f"{why_not(node, self._mapping)}. {TEACH.format(node.path)}"


def choose(
    nodes: Sequence[Node], mapping: Mapping | None = None, device: str | None = None
) -> tuple[Node, Mapping] | None:
    """The pad to use and its layout: `device` if given (links are followed), else the first; None if none is there.

    Raises `DeviceError` if `device` is there and is no such pad.
    """
    if device is None:
        return next((found for node in nodes if (found := _with_layout(node, mapping))), None)
    real = os.path.realpath(device)
    node = next((node for node in nodes if real == os.path.realpath(node.path)), None)
    if node is not None:
        found = _with_layout(node, mapping)
        if found is None:
            raise DeviceError(why_not(node, mapping), f"{TEACH.format(device)}, or choose another --device.")
        return found
    if Path(real).exists() and not Path(real).name.startswith("event"):
        raise DeviceError(f"{device} is no event device", "Give its /dev/input/event*; see /proc/bus/input/devices.")
    return None


def _with_layout(node: Node, mapping: Mapping | None) -> tuple[Node, Mapping] | None:
    if mapping is None:
        mapping = layout_of(node)
    elif node.is_motion or missing(node, mapping):
        return None
    return None if mapping is None else (node, mapping)
