"""The rumble motors of an open pad. Some clones rumble until they are told to stop, so every end is told."""

from typing import Protocol

LONGEST_RUMBLE_MS = 1000  # the kernel ends an effect by itself if we do not live to do so
FULL = 0xFFFF


class Effects(Protocol):
    """What of an input device rumbles."""

    def upload_rumble(self, level: int, longest_ms: int) -> int:
        """Give it a rumble; its number."""

    def play(self, effect: int, on: bool) -> None:
        """Begin or end it."""

    def erase(self, effect: int) -> None:
        """Take it away."""


class Motor:
    """Rumbles at a strength until told otherwise. A device without motors (not `works`) does nothing."""

    def __init__(self, device: Effects, *, works: bool = True) -> None:
        self._device = device
        self._works = works
        self._strength = 0.0
        self._effect = -1

    def set(self, strength: float) -> None:
        """Rumble at `strength` in [0, 1] from now on, for at most a second; 0 stops."""
        if not self._works or strength == self._strength:
            return
        try:
            self._stop()
            if strength > 0.0:
                self._effect = self._device.upload_rumble(round(FULL * strength), LONGEST_RUMBLE_MS)
                self._device.play(self._effect, True)
        except OSError:
            # The pad is gone (reading it says so), or it promises motors and has none: then it stays still.
            self._works, self._effect = False, -1
        self._strength = strength

    def _stop(self) -> None:
        if self._effect >= 0:
            effect, self._effect = self._effect, -1
            self._device.play(effect, False)
            self._device.erase(effect)
