"""The wheels as the firmware regulates and reckons them: they swing about what they are to do, and slip in a turn.

Source: the firmware's regulator, which changes a wheel's speed by one step a period, up or down, and so never rests
on a speed between two steps; and its odometry, to which a turn on the spot looks like a little motion back.
"""

import math
from dataclasses import replace

from lira.hal.messages import Odometry, Twist
from lira.hal.profile import Base

PERIOD_S = 0.01
SPIN_SLIP_M_RAD = -0.0114
LONGEST_S = 1.0  # what was not worked on for longer is not made up for


class Regulators:
    """Both sides' wheels. The time comes in."""

    def __init__(self, base: Base) -> None:
        self._track_m = base.track_m
        self.step_m_s = base.acceleration_m_s2 * PERIOD_S
        self._steps = [0, 0]  # speeds of left and right
        self._worked_s = -math.inf
        self._before: Odometry | None = None
        self._slip_m = (0.0, 0.0)

    def drive(self, target: Twist, now_s: float) -> Twist:
        """Return how the body is driven now, on the way to a target."""
        periods = int(min(now_s - self._worked_s, LONGEST_S) / PERIOD_S)
        self._worked_s = now_s if periods * PERIOD_S >= LONGEST_S else self._worked_s + periods * PERIOD_S
        turn_m_s = target.angular_rad_s * self._track_m / 2
        for side, speed_m_s in enumerate((target.linear_m_s - turn_m_s, target.linear_m_s + turn_m_s)):
            wanted = speed_m_s / self.step_m_s
            for _ in range(periods):
                self._steps[side] += (self._steps[side] < wanted) - (self._steps[side] > wanted)
        left_m_s, right_m_s = (steps * self.step_m_s for steps in self._steps)
        return Twist((left_m_s + right_m_s) / 2, (right_m_s - left_m_s) / self._track_m)

    def reckon(self, odom: Odometry) -> Odometry:
        """What the firmware makes of an odometry without slip."""
        before, self._before = self._before or odom, odom
        turn_rad = math.remainder(odom.yaw_rad - before.yaw_rad, math.tau)
        slip_m, heading_rad = SPIN_SLIP_M_RAD * turn_rad, before.yaw_rad + turn_rad / 2
        east_m, north_m = self._slip_m
        self._slip_m = (east_m + slip_m * math.cos(heading_rad), north_m + slip_m * math.sin(heading_rad))
        return replace(
            odom,
            x_m=odom.x_m + self._slip_m[0],
            y_m=odom.y_m + self._slip_m[1],
            linear_m_s=odom.linear_m_s + SPIN_SLIP_M_RAD * odom.angular_rad_s,
        )
