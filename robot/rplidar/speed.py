"""How fast the head turns: held at what the profile wants by what is measured, and watched. Pure; the time comes in."""

import math

from lira.hal.errors import DeviceError

DEAD_BAND = 0.02  # of the speed: so far off is good enough
SETTLE_S = 1.5  # a head needs so long to follow its motor
DAMPING = 0.7  # of what a step corrects: a motor with friction answers more than in proportion
DUTIES = (300, 1023)
SLOWEST_HZ, FASTEST_HZ = 5.0, 15.0  # that a unit is made for
TRIES = 5  # in a row that did not help: it does not listen

FIRST_TURN_S = 10.0  # a head may need so long until it turns evenly
TURN_S = 1.0  # half as fast as the slowest that is understood
SILENCE_S = 0.5
MOTOR = "Its motor gets too little power, or its head is blocked: use a supply or a port that gives 1 A."
CABLE = "Check its cable and power, and that the path is the lidar's."


class SpeedRegulator:
    """Trims the motor's duty until the head turns as often as wanted."""

    def __init__(self, wanted_hz: float, duty: int, now_s: float) -> None:
        self.wanted_hz = min(max(wanted_hz, SLOWEST_HZ), FASTEST_HZ)
        self.duty = duty
        self._until_s = now_s + SETTLE_S
        self._tries = 0
        self.off = False

    def turned(self, rate_hz: float, now_s: float) -> int | None:
        """Take the measured speed; returns the duty that the motor has to be told now, if it has."""
        if not rate_hz > 0.0:
            return None
        share = self.wanted_hz / rate_hz
        self.off = abs(share - 1.0) > DEAD_BAND
        if not self.off:
            self._tries = 0
        if not self.off or now_s < self._until_s or self._tries >= TRIES:
            return None
        low, high = DUTIES
        duty = min(max(round(self.duty * (1.0 + DAMPING * (share - 1.0))), low), high)
        self._tries += 1
        self._until_s = now_s + SETTLE_S
        if duty == self.duty:
            return None
        self.duty = duty
        return duty


class TurnWatchdog:
    """Tells a unit that scans from one that only sends."""

    def __init__(self, url: str, now_s: float) -> None:
        self._url = url
        self._turns = 0
        self._turned_s = self._heard_s = self._looked_s = now_s
        self._points, self._pointed_s = 0, now_s

    def look(self, now_s: float, *, heard: bool, points: int, turns: int, swept_rad: float) -> None:
        """Raise `DeviceError` for one that is lost. `points` and `turns` have come, the head went `swept_rad` since."""
        if now_s - self._looked_s > SILENCE_S:  # who watches stood still: that says nothing of the unit
            self._turned_s = self._heard_s = self._pointed_s = now_s
        self._looked_s = now_s
        if heard:
            self._heard_s = now_s
        if points > self._points:
            self._points, self._pointed_s = points, now_s
        if turns > self._turns:
            self._turns, self._turned_s = turns, now_s
        patience_s = TURN_S if self._turns else FIRST_TURN_S
        silent_s, without_s = now_s - self._heard_s, now_s - self._turned_s
        if silent_s > (SILENCE_S if self._turns else FIRST_TURN_S):
            raise DeviceError(f"the lidar at {self._url} {self._silence()}", f"{MOTOR} Check its cable, too.")
        if without_s <= patience_s:
            return
        if now_s - self._pointed_s > SILENCE_S:
            raise DeviceError(f"the lidar at {self._url} sends nothing that is a scan", CABLE)
        hz = swept_rad / math.tau / without_s
        raise DeviceError(f"the head of the lidar at {self._url} turns at {hz:.1f} Hz only, if at all", MOTOR)

    def _silence(self) -> str:
        return "fell silent" if self._turns else f"has not begun to scan within {FIRST_TURN_S:.0f} s"
