"""The head of an RPLIDAR: how fast it turns, where it looks, and what its optics make of that. Pure."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lira.sim_backend.emulators.rplidar_models import Model
from lira.sim_backend.polyline import Floats

Distances = Callable[[Floats], Floats]
"""Distances in metres [n] at the unit's clockwise angles in radians [n]; 0 where nothing comes back."""

SETTLED = 3.0  # time constants until it counts as steady
STEADY = 0.1  # of its speed
PWM = 660
# What comes back from far away lies so far behind where the head looks, and from nearby less: a triangle. As the
# vendor's client has it for the streams that leave it to the client.
FAR_RAD, NEAR_M_RAD = math.radians(8.0), 98361 / 4000 * 64 / 65536
EDGE = 0.1  # a jump of more than this share of the distance has no clear return


class Head:
    """Turns after the motor's duty. The clock is the caller's, and never runs back."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._settle_s = model.spin_up_s / SETTLED
        self._since_s, self._turns, self._hz, self._wanted_hz = 0.0, 0.0, 0.0, 0.0
        if not model.has_pwm:
            self._hz = self._wanted_hz = model.hz_at_660

    def tell(self, pwm: int, now_s: float) -> None:
        """Set the motor's duty."""
        if self._model.has_pwm:
            self._turns, self._hz = float(self.turns(np.array(now_s))), self.hz(now_s)
            self._since_s, self._wanted_hz = now_s, self._model.hz_at_660 * pwm / PWM

    @property
    def moving(self) -> bool:
        """Whether it is to turn."""
        return self._wanted_hz > 0.0

    @property
    def course(self) -> tuple[float, float, float]:
        """Since when it has been told to turn how fast (Hz), and how many turns it had made by then."""
        return self._since_s, self._wanted_hz, self._turns

    @property
    def steady_s(self) -> float:
        """From when on it turns about as fast as it shall; never if it is to stand."""
        if not self.moving:
            return math.inf
        off = abs(self._hz - self._wanted_hz) / (STEADY * self._wanted_hz)
        return self._since_s + (self._settle_s * math.log(off) if off > 1.0 else 0.0)

    def hz(self, now_s: float) -> float:
        """Turns per second."""
        return self._wanted_hz + (self._hz - self._wanted_hz) * self._left(now_s - self._since_s)

    def turns(self, at_s: Floats) -> Floats:
        """Turns that it has made by these times [...]."""
        spent_s = at_s - self._since_s
        lag_s = self._settle_s * (1.0 - np.exp(-spent_s / self._settle_s)) if self._settle_s else 0.0
        turns: Floats = self._turns + self._wanted_hz * spent_s + (self._hz - self._wanted_hz) * lag_s
        return turns

    def _left(self, spent_s: float) -> float:
        return math.exp(-spent_s / self._settle_s) if self._settle_s else 0.0


@dataclass(frozen=True, slots=True)
class Samples:
    """What the head measured [n]: where it looked (clockwise, radians), how far behind that the points lie, metres."""

    theta_rad: Floats
    behind_rad: Floats
    distance_m: Floats

    def part(self, start: int, end: int | None = None) -> "Samples":
        """Those from one place to another."""
        return Samples(self.theta_rad[start:end], self.behind_rad[start:end], self.distance_m[start:end])

    def then(self, later: "Samples") -> "Samples":
        """These and later ones."""
        pairs = (
            (self.theta_rad, later.theta_rad),
            (self.behind_rad, later.behind_rad),
            (self.distance_m, later.distance_m),
        )
        return Samples(*(np.concatenate(pair) for pair in pairs))


NO_SAMPLES = Samples(np.empty(0), np.empty(0), np.empty(0))


class Optics:
    """Laser and camera. Without triangulation every point lies where the head looks."""

    def __init__(self, model: Model, distances: Distances, seed: int = 0) -> None:
        self._model = model
        self._distances = distances
        self._random = np.random.default_rng(seed)
        self._last_m = 0.0

    def look(self, theta_rad: Floats, *, corrected: bool) -> Samples:
        """Measure at these angles of the head [n]; `corrected`: the stream can say that a point lies behind it."""
        if not (self._model.triangulates and corrected):
            return Samples(theta_rad, np.zeros(len(theta_rad)), self._spoil(self._distances(theta_rad)))
        behind_rad = np.full(len(theta_rad), FAR_RAD)
        for _ in range(2):  # where it lies depends on how far away it is, and that on where it lies
            behind_rad = behind(self._distances((theta_rad - behind_rad) % math.tau))
        distance_m = self._spoil(self._distances((theta_rad - behind_rad) % math.tau))
        return Samples(theta_rad, np.where(distance_m > 0.0, behind_rad, 0.0), distance_m)

    def _spoil(self, distance_m: Floats) -> Floats:
        """Put zeros at edges, and now and then elsewhere."""
        if self._model.triangulates and len(distance_m):
            before = np.concatenate([[self._last_m], distance_m[:-1]])
            self._last_m = float(distance_m[-1])
            edge = np.abs(distance_m - before) > EDGE * np.maximum(distance_m, before)
            distance_m = np.where(edge, 0.0, distance_m)
        if self._model.zeros:
            distance_m = np.where(self._random.random(len(distance_m)) < self._model.zeros, 0.0, distance_m)
        return distance_m


def behind(distance_m: Floats) -> Floats:
    """How far behind the head's direction a point at a distance [n] lies, radians; `FAR_RAD` for none."""
    near = np.maximum(distance_m, 0.05)
    return np.where(distance_m > 0.0, FAR_RAD - NEAR_M_RAD / near, FAR_RAD)
