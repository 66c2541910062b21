"""A pad's device: opened, read without waiting, made to rumble. The only page that needs `evdev`."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import evdev
from evdev import ecodes, ff

from lira.hal.errors import DeviceError
from lira.tools.joystick.axes import AxisRange, PadEvent, PadState
from lira.tools.joystick.codes import EV_SYN, SYN_DROPPED, SYN_REPORT
from lira.tools.joystick.mapping import Mapping
from lira.tools.joystick.nodes import Node, choose, motion_of, read_nodes

LONGEST_RUMBLE_MS = 1000  # the kernel ends an effect by itself if we do not live to do so
FULL = 0xFFFF
REMEDY = (
    "Install tools/joystick/60-lira-pad.rules in /etc/udev/rules.d and plug it in again, "
    "or join the group: sudo usermod -aG input $USER, then log in again."
)


class Finder:
    """Opens the pad when it is there, and after that only the same one again. Call it; raises `DeviceError`."""

    def __init__(self, mapping: Mapping, device: str | None = None) -> None:
        self._mapping = mapping
        self._device = device
        self._identity: tuple[str, ...] | None = None

    def __call__(self) -> "Pad | None":
        """The open pad; None while it is not there."""
        nodes = read_nodes()
        known = nodes if self._identity is None else [node for node in nodes if node.identity == self._identity]
        node = choose(known, self._mapping, self._device)
        if node is None:
            return None
        pad = Pad(node, motion_of(node, nodes))
        self._identity = node.identity
        return pad


class Pad:
    """An open pad, and its motion sensors if it has any.

    Raises `DeviceError` when it cannot be opened, and from `read` when it is lost.
    """

    def __init__(self, node: Node, motion: Node | None = None) -> None:
        self.name = str(node)
        self.key = node.key
        self._path = Path(node.path)
        self._device = _open(node)
        self.state = self._whole_state()
        self._dropped = False
        self._motion = None if motion is None else _open(motion)
        self._motor = Motor(self._device)

    @property
    def has_motion(self) -> bool:
        """Whether it has motion sensors, so that it is never silent."""
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
            axes: Sequence[tuple[int, Any]] = self._device.capabilities().get(ecodes.EV_ABS, [])  # type: ignore[assignment]
            ranges = {code: AxisRange(info.min, info.max) for code, info in axes}
            values = {code: info.value for code, info in axes}
            return PadState(ranges, values, frozenset(self._device.active_keys()))
        except OSError as error:
            raise _lost(self.name, error) from error


class Motor:
    """The rumble motors of an open device; a device without them does nothing.

    Some clones rumble until they are told to stop, so every end is told, and the effect is taken away.
    """

    def __init__(self, device: Any) -> None:
        self._device = device
        self._works = ecodes.FF_RUMBLE in device.capabilities().get(ecodes.EV_FF, [])
        self._strength = 0.0
        self._effect = -1

    def set(self, strength: float) -> None:
        """Rumble at `strength` in [0, 1] from now on, for at most a second; 0 stops."""
        if not self._works or strength == self._strength:
            return
        try:
            self._stop()
            if strength > 0.0:
                self._start(strength)
        except OSError:
            # The pad is gone (reading it says so), or it promises motors and has none: then it stays still.
            self._works, self._effect = False, -1
        self._strength = strength

    def _start(self, strength: float) -> None:
        level = round(FULL * strength)
        rumble = ff.Rumble(strong_magnitude=level, weak_magnitude=level)
        replay = ff.Replay(LONGEST_RUMBLE_MS, 0)
        effect = ff.Effect(ecodes.FF_RUMBLE, -1, 0, ff.Trigger(0, 0), replay, ff.EffectType(ff_rumble_effect=rumble))
        self._effect = self._device.upload_effect(effect)
        self._device.write(ecodes.EV_FF, self._effect, 1)

    def _stop(self) -> None:
        if self._effect >= 0:
            self._device.write(ecodes.EV_FF, self._effect, 0)
            self._device.erase_effect(self._effect)
            self._effect = -1


def _open(node: Node) -> evdev.InputDevice[str]:
    try:
        return evdev.InputDevice(node.path)
    except PermissionError as error:
        raise DeviceError(f"no permission to open {node}", REMEDY) from error
    except (OSError, SystemError) as error:  # evdev's word for a device that goes while it is being opened
        raise _lost(str(node), error) from error


def _read(device: Any) -> list[PadEvent]:
    """What came, without waiting."""
    try:
        events = [PadEvent(event.type, event.code, event.value) for event in device.read()]
    except BlockingIOError:
        return []
    except OSError as error:
        raise _lost(device.path, error) from error
    if not events:  # nothing, and no word that nothing is there yet: the end of the file
        raise DeviceError(f"{device.path} was closed", "Plug it in or switch it on again.")
    return events


def _lost(what: str, error: OSError | SystemError) -> DeviceError:
    why = error.strerror if isinstance(error, OSError) else error
    return DeviceError(f"{what} is gone: {why}", "Plug it in or switch it on again.")
