"""The script of motions: what is commanded, and for how long. It ends about where it began."""

from dataclasses import dataclass

from lira.hal.messages import STOP, Twist
from lira.hal.profile import Base

STAND_S = 3.0  # both robots see the same then, if they stand in the same place
STEP_S = 2.0
REST_S = 1.5
SETTLED_S = 0.6  # the last part of a step counts as settled
REACH_M = 0.8  # of free floor that a step may take
TURN_RAD = 1.6


@dataclass(frozen=True, slots=True)
class Leg:
    """A constant command."""

    name: str
    twist: Twist
    duration_s: float


def motions(base: Base) -> tuple[Leg, ...]:
    """Return the script for a base: stand, ahead and back, left and right, each from rest to rest.

    Half its top speed, or less where that would go farther than `REACH_M` or turn by more than `TURN_RAD`.
    """
    linear_m_s = min(base.max_linear_m_s / 2, REACH_M / STEP_S)
    angular_rad_s = min(base.max_angular_rad_s / 2, TURN_RAD / STEP_S)
    steps = {
        "ahead": Twist(linear_m_s, 0.0),
        "back": Twist(-linear_m_s, 0.0),
        "left": Twist(0.0, angular_rad_s),
        "right": Twist(0.0, -angular_rad_s),
    }
    script = [Leg("stand", STOP, STAND_S)]
    for name, twist in steps.items():
        script += [Leg(name, twist, STEP_S), Leg(f"{name} stop", STOP, REST_S)]
    return tuple(script)
