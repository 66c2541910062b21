"""A pad that is open: its state after every report, its motion sensors, its motors."""

import os
from pathlib import Path

from lira.hal.errors import DeviceError
from lira.tools.joystick.axes import AxisRange, PadEvent, PadState
from lira.tools.joystick.device.event_device import FF_RUMBLE, EventDevice
from lira.tools.joystick.device.rules import REMEDY
from lira.tools.joystick.device.rumble_motor import Motor
from lira.tools.joystick.pads.codes import EV_SYN, SYN_DROPPED, SYN_REPORT
from lira.tools.joystick.pads.mapping import Mapping
from lira.tools.joystick.pads.nodes import Node


class Pad:
    """An open pad, and its motion sensors if it has any that may be read; `motion_trouble` says why not.

    Raises `DeviceError` when it cannot be opened, and from `read` when it is lost.
    """

    def __init__(self, node: Node, mapping: Mapping, motion: Node | None = None) -> None:
        self.name = str(node)
        self.key = node.key
        self.mapping = mapping
        self.motion_trouble = ""
        self._node = node
        self._path = Path(node.path)
        self._device = _open(node)
        self._dropped = False
        self._motion: EventDevice | None = None
        try:
            self.state = self._whole_state()
        except DeviceError:
            self._device.close()
            raise
        if motion is not None:
            try:
                self._motion = _open(motion)
            except DeviceError as error:
                self.motion_trouble = str(error)
        self._motor = Motor(self._device, works=FF_RUMBLE in node.effects)

    @property
    def has_motion(self) -> bool:
        """Whether it has motion sensors that are read, so that it is never silent."""
        return self._motion is not None

    def fileno_list(self) -> list[int]:
        """What to wait for."""
        return [device.fd for device in (self._device, self._motion) if device is not None]

    def read(self) -> tuple[list[PadState], bool]:
        """States after each report since the last call, and whether anything came at all, motion included.

        Raises `DeviceError` when the pad is gone, or is no longer ours to read: an open device would not say that.
        """
        if self._path.exists() and not os.access(self._path, os.R_OK):
            raise DeviceError(f"no permission to read {self.name} any more", REMEDY)
        moved = bool(_read(self._motion)) if self._motion is not None else False
        events = _read(self._device)
        states: list[PadState] = []
        for event in events:
            self._take(event, states)
        return states, moved or bool(events)

    def rumble(self, strength: float) -> None:
        """Rumble at a strength in [0, 1] from now on, for at most a second; 0 stops."""
        self._motor.set(strength)

    def close(self) -> None:
        """Stop the motors and close. May be called on a pad that is gone."""
        self._motor.set(0.0)
        for device in (self._device, self._motion):
            if device is not None:
                device.close()

    def _take(self, event: PadEvent, states: list[PadState]) -> None:
        if event.kind != EV_SYN:
            if not self._dropped:
                self.state = self.state.after(event)
        elif event.code == SYN_DROPPED:
            self._dropped = True  # what follows up to the next report is incomplete
        elif event.code == SYN_REPORT:
            if self._dropped:
                self.state, self._dropped = self._whole_state(), False
            states.append(self.state)

    def _whole_state(self) -> PadState:
        try:
            axes = {code: self._device.axis(code) for code in sorted(self._node.axes)}
            ranges = {code: AxisRange(least, most) for code, (_, least, most) in axes.items()}
            values = {code: value for code, (value, _, _) in axes.items()}
            return PadState(ranges, values, self._device.pressed())
        except OSError as error:
            raise _lost(self.name, error) from error


def _open(node: Node) -> EventDevice:
    try:
        return EventDevice(node.path)
    except PermissionError as error:
        raise DeviceError(f"no permission to open {node}", REMEDY) from error
    except OSError as error:
        raise _lost(str(node), error) from error


def _read(device: EventDevice) -> list[PadEvent]:
    """What came, without waiting."""
    try:
        return device.read()
    except OSError as error:
        raise _lost(device.path, error) from error
    except EOFError as error:
        raise DeviceError(f"{device.path} was closed", "Plug it in or switch it on again.") from error


def _lost(what: str, error: OSError) -> DeviceError:
    return DeviceError(f"{what} is gone: {error.strerror}", "Plug it in or switch it on again.")
