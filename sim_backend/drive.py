"""How the base moves. One vectorised step serves the twin (one robot) and the planner (many imagined ones).

"kinematic": the velocity is the target at once, integrated exactly along the arc.
"wheels": the firmware of the CORE2 at 100 Hz turns the target into two wheel speeds (v -+ omega track / 2, at most
1 m/s) and ramps towards them; four fixed wheels skid in a turn, so the body turns as if the track were wider.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from lira.hal.profile import Base
from lira.sim_backend.polyline import Floats

FIRMWARE_PERIOD_S = 0.01
FIRMWARE_WATCHDOG_S = 1.0
WHEEL_LIMIT_M_S = 1.0
TINY_RAD = 1e-20


@dataclass(frozen=True, slots=True)
class Motion:
    """Pose and velocity of base_link, arrays [...] of one shape."""

    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    linear_m_s: Floats
    angular_rad_s: Floats

    @property
    def xy(self) -> Floats:
        """Position [..., 2]."""
        return np.stack([self.x_m, self.y_m], axis=-1)

    @property
    def arrays(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """All five."""
        return self.x_m, self.y_m, self.yaw_rad, self.linear_m_s, self.angular_rad_s


def motion(x_m: float, y_m: float, yaw_rad: float, linear_m_s: float = 0.0, angular_rad_s: float = 0.0) -> Motion:
    """Make the motion of a single robot, arrays of shape []."""
    return Motion(*map(number, (x_m, y_m, yaw_rad, linear_m_s, angular_rad_s)))


def number(value: float) -> Floats:
    """One robot's number as numpy has it: an array without axes does the same and takes several times as long."""
    return cast(Floats, np.float64(value))


def step(base: Base, now: Motion, linear_m_s: Floats, angular_rad_s: Floats, duration_s: float) -> Motion:
    """Move for `duration_s` towards a target velocity [...]."""
    if base.drive == "kinematic":
        return glide(now, linear_m_s, angular_rad_s, duration_s)
    count = max(math.ceil(duration_s / FIRMWARE_PERIOD_S - 1e-9), 1)
    for _ in range(count):
        linear, angular = ramp_wheels(base, now, linear_m_s, angular_rad_s, duration_s / count)
        now = glide(now, linear, angular, duration_s / count)
    return now


def path(base: Base, now: Motion, linear_m_s: Floats, angular_rad_s: Floats, duration_s: float) -> Motion:
    """Where robots [N] are after each of K target velocities [N, K], each held so long: arrays [N, K].

    The same to the bit as `step` after `step`: sums are added up in the same order.
    """
    if base.drive == "kinematic":
        half_turn = angular_rad_s * duration_s / 2
        chord = linear_m_s * duration_s * chord_of_arc(half_turn)
        yaw = _sums(now.yaw_rad, 2 * half_turn)
        ahead = yaw[:, :-1] + half_turn
        x, y = _sums(now.x_m, chord * np.cos(ahead)), _sums(now.y_m, chord * np.sin(ahead))
        return Motion(x[:, 1:], y[:, 1:], yaw[:, 1:], linear_m_s, angular_rad_s)
    moments = []
    for linear, angular in zip(linear_m_s.T, angular_rad_s.T, strict=True):
        now = step(base, now, linear, angular, duration_s)
        moments.append(now)
    return in_time(moments)


def in_time(moments: Sequence[Motion]) -> Motion:
    """Moments of some robots [N] as arrays [N, K]."""
    return Motion(*(np.stack(values, axis=-1) for values in zip(*(each.arrays for each in moments), strict=True)))


def _sums(begin: Floats, terms: Floats) -> Floats:
    """Running sums [N, K + 1] of terms [N, K], from what each begins with [N]."""
    return np.add.accumulate(np.concatenate([begin[:, None], terms], axis=1), axis=1)


def ramp_wheels(
    base: Base, now: Motion, linear_m_s: Floats, angular_rad_s: Floats, duration_s: float
) -> tuple[Floats, Floats]:
    """Velocity of the body after the firmware has worked on the wheels for `duration_s`."""
    change = base.acceleration_m_s2 * duration_s
    wheels = []
    for side in (-0.5, 0.5):
        target = linear_m_s + side * angular_rad_s * base.track_m
        target = np.clip(target, -WHEEL_LIMIT_M_S, WHEEL_LIMIT_M_S)
        speed = now.linear_m_s + side * now.angular_rad_s * effective_track_m(base)
        wheels.append(speed + np.clip(target - speed, -change, change))
    left, right = wheels
    return (left + right) / 2, (right - left) / effective_track_m(base)


def glide(now: Motion, linear_m_s: Floats, angular_rad_s: Floats, duration_s: float) -> Motion:
    """Follow an arc of constant velocity, exactly."""
    half_turn = angular_rad_s * duration_s / 2
    chord = linear_m_s * duration_s * chord_of_arc(half_turn)
    return Motion(
        now.x_m + chord * np.cos(now.yaw_rad + half_turn),
        now.y_m + chord * np.sin(now.yaw_rad + half_turn),
        now.yaw_rad + 2 * half_turn,
        linear_m_s,
        angular_rad_s,
    )


def chord_of_arc(half_turn_rad: Floats) -> Floats:
    """How long the chord is of an arc of length 1: sin(x) / x of half its angle, 1 where it is straight."""
    one = half_turn_rad.ndim == 0
    angle = half_turn_rad or TINY_RAD if one else np.where(half_turn_rad == 0.0, TINY_RAD, half_turn_rad)
    share: Floats = np.sin(angle) / angle
    return share


def effective_track_m(base: Base) -> float:
    """Return the track the body turns by."""
    return base.effective_track_m or base.track_m


def reckon(base: Base, odometry: Motion, before: Motion, after: Motion, duration_s: float) -> Motion:
    """Carry the odometry on over a short move, as the firmware reckons: by its own idea of the track."""
    skid = effective_track_m(base) / (base.odometry_track_m or base.track_m)
    turn = after.yaw_rad - before.yaw_rad
    ahead = before.yaw_rad + turn / 2
    chord = (after.x_m - before.x_m) * np.cos(ahead) + (after.y_m - before.y_m) * np.sin(ahead)
    linear = chord / chord_of_arc(turn / 2) / duration_s
    there = glide(odometry, linear, turn * skid / duration_s, duration_s)
    return Motion(there.x_m, there.y_m, there.yaw_rad, after.linear_m_s, after.angular_rad_s * skid)
