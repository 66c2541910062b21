"""`lira joystick --learn`: ask for each control, watch the pad, write its file."""

import os
import select
import time
from pathlib import Path

from lira.hal.config import write_whole
from lira.hal.errors import ConfigError, DeviceError, StorageError
from lira.tools.joystick.axes import PadState
from lira.tools.joystick.device.finder import NONE_THERE
from lira.tools.joystick.device.pad import Pad
from lira.tools.joystick.pad_detect import ASKS, Ask, moved_axis, pressed_button, to_toml
from lira.tools.joystick.pads.mapping import Axis, load_mapping
from lira.tools.joystick.pads.nodes import Node, is_any_pad, motion_of, read_nodes

ANSWER_S, OPTIONAL_S = 30.0, 8.0
LOOK_S = 0.1


def learn(path: Path, device: str | None) -> int:
    """Ask, and write the file.

    Raises `DeviceError` without a pad or an answer, `StorageError` or, for its name, `ConfigError` for the file.
    """
    if path.suffix != ".toml":  # by which `--pad` knows it
        raise ConfigError(f"{path} is no .toml file", f"Name the pad's file {path.name or 'my-pad'}.toml.")
    if path.exists():
        raise StorageError(f"{path} is already there", "Choose another file name.")
    nodes = read_nodes()
    node = _find(nodes, device)
    has_motion = motion_of(node, nodes) is not None
    pad = Pad(node, load_mapping("ps3"))
    print(f"{node}: leave it at rest now", flush=True)
    found: dict[str, Axis | str] = {}
    try:
        for ask in ASKS:
            rest = pad.state
            print(f"  {ask.words} ... ", end="", flush=True)
            answer = _answer(pad, rest, ask, taken=list(found.values()))
            if answer is None:
                print("none", flush=True)
                continue
            found[ask.key] = answer
            print(answer.axis if isinstance(answer, Axis) else answer, flush=True)
            _wait_for_rest(pad, rest, answer)
    finally:
        pad.close()
    write_whole(path, to_toml(node.name, found, node.axes, node.buttons, freeze=has_motion).encode())
    if not has_motion:
        print("it has no motion sensors: nobody will notice if it freezes")
    print(f"written: {path}; use it with: lira joystick --pad {path}")
    return 0


def _find(nodes: list[Node], device: str | None) -> Node:
    """The pad to learn, through links. Raises `DeviceError` if there is none."""
    if device is None:
        pads = [node for node in nodes if is_any_pad(node)]
        if not pads:
            raise DeviceError(NONE_THERE, "See /proc/bus/input/devices for what the kernel knows.")
        return pads[0]
    real = os.path.realpath(device)
    node = next((node for node in nodes if real == os.path.realpath(node.path)), None)
    if node is None:
        raise DeviceError(f"there is no input device {device}", "See ls -l /dev/input/by-id.")
    if not is_any_pad(node):
        raise DeviceError(f"{node} is no gamepad", "Give another --device; see /proc/bus/input/devices.")
    return node


def _answer(pad: Pad, rest: PadState, ask: Ask, taken: list[Axis | str]) -> Axis | str | None:
    names = [other.axis if isinstance(other, Axis) else other for other in taken]
    driving = frozenset(other.axis for other in taken if isinstance(other, Axis))
    deadline_s = time.monotonic() + (OPTIONAL_S if ask.optional else ANSWER_S)
    while time.monotonic() < deadline_s:
        for state in _look(pad):
            answer = moved_axis(rest, state) if ask.is_axis else pressed_button(rest, state, driving)
            if answer is not None and (answer.axis if isinstance(answer, Axis) else answer) not in names:
                return answer
    if ask.optional:
        return None
    raise DeviceError("nothing was pressed", "Start again, and press one control at a time.")


def _wait_for_rest(pad: Pad, rest: PadState, answer: Axis | str) -> None:
    deadline_s = time.monotonic() + ANSWER_S
    while time.monotonic() < deadline_s:
        held = moved_axis(rest, pad.state) if isinstance(answer, Axis) else pressed_button(rest, pad.state)
        if held is None:
            return
        _look(pad)
    raise DeviceError("a control did not come back to rest", "Start again, and let go of each control.")


def _look(pad: Pad) -> list[PadState]:
    select.select(pad.fileno_list(), [], [], LOOK_S)
    return pad.read()[0]
