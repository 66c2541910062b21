"""The shield: a turn on which the robot would touch what its lidar sees gives way to the nearest one that is clear.

In the symbols of this page, all in the frame of the robot, metres and radians:

    p_j          what bin j of the scan saw [m, 2]; a bin without a return is no point
    q_k(w)       where the robot is after t_k at its speed v and turn rate w [T, 2]: an arc
    d_j(w)       min over k of |p_j - q_k(w)|
    R            radius of the circle around the body;  M  what is kept free around it

A turn is *clear* with M if d_j(w) >= min(R + M, |p_j|) for all j: the robot comes no nearer to anything than that, or
than it is already. Where no turn keeps the margin, one is enough that touches nothing (M = 0); where there is none of
these either, it stands, and calls.

A shield helps where the lidar sees, at the height of its plane, within the field of view of the features; what only the
camera could see is not its business. It does not learn, and nothing is learned from it. The protective field of the
robot itself (`hal/safety`) is another thing: that one stops, whoever drives.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lira.fusion.methods.base import STAND, Around, Choice, Lesson, Method, Policy, Proposal
from lira.fusion.preprocess import Features
from lira.hal.errors import ConfigError
from lira.hal.messages import Action, Call, Driver, FloatArray, Phase
from lira.hal.profile import RobotProfile

HORIZON_S = 1.2  # t_T
MARGINS_M = (0.10, 0.0)  # M, what is wished for first
STEPS = 24  # T
TURNS = np.linspace(-1.0, 1.0, 41)
EDGE_M = 1e-3  # a beam is no more exact, and the robot is told to come no nearer than it is

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Shield:
    """What it has to know of a robot. Raises `ConfigError` for one that does not learn from a lidar."""

    profile: RobotProfile

    def __post_init__(self) -> None:
        if "scan" not in self.profile.features.inputs:
            what = f"'{self.profile.name}' has no lidar among its inputs for a shield to look with"
            raise ConfigError(what, "Leave --shield out; the robot's own protective field does not need it.")

    def points(self, scan: FloatArray) -> Floats:
        """p [m, 2] of a scan as the networks see it, float32 [bins]; too close counts as at the shortest range."""
        shape, lidar = self.profile.features, self.profile.lidar
        angles = (np.arange(shape.bins) + 0.5) * shape.fov_rad / shape.bins - shape.fov_rad / 2
        seen = scan < 1.0
        ranges = np.maximum(scan[seen].astype(np.float64) * shape.max_range_m, lidar.range_min_m)
        return np.stack([lidar.x_m + ranges * np.cos(angles[seen]), ranges * np.sin(angles[seen])], axis=1)

    def clear(self, points: Floats, linear: float, turns: Floats, margin_m: float) -> NDArray[np.bool_]:
        """Whether each turn [n] in [-1, 1] is clear at a speed in [-1, 1]."""
        base = self.profile.base
        keep_m = np.minimum(math.hypot(base.length_m, base.width_m) / 2 + margin_m, np.linalg.norm(points, axis=1))
        q = arcs(linear * base.max_linear_m_s, turns * base.max_angular_rad_s)
        distances = np.linalg.norm(points[None, :, None] - q[:, None], axis=3).min(axis=2)
        free: NDArray[np.bool_] = (distances >= keep_m - EDGE_M).all(axis=1)
        return free

    def __call__(self, action: Action, scan: FloatArray) -> Action:
        """Return the action, or the same with the nearest turn that is clear, or to stand."""
        linear, angular = action
        if linear <= 0.0:
            return action  # on the spot nothing comes nearer, and behind it the features do not look
        points = self.points(scan)
        for margin_m in MARGINS_M:
            if self.clear(points, linear, np.array([angular]), margin_m)[0]:
                return action
            free = TURNS[self.clear(points, linear, TURNS, margin_m)]
            if free.size:
                return linear, float(free[np.argmin(np.abs(free - angular))])
        return STAND


def arcs(v_m_s: float, w_rad_s: Floats) -> Floats:
    """q [n, T, 2] of turn rates [n]: chords of the circle, exact for a turn rate of zero, too."""
    t = np.linspace(HORIZON_S / STEPS, HORIZON_S, STEPS)
    half = w_rad_s[:, None] * t / 2
    chord = v_m_s * t * np.sinc(half / np.pi)
    return np.stack([chord * np.cos(half), chord * np.sin(half)], axis=2)


class Shielded(Around):
    """A method that drives alone, behind a shield."""

    def __init__(self, method: Method, shield: Shield) -> None:
        super().__init__(method)
        self._shield = shield

    def propose(self, features: Features) -> Proposal:
        """What the method proposes, with a turn that is clear. `Proposal.novice` still says what the novice wanted."""
        return self._clear(self._method.propose(features))

    def propose_all(self, seen: Sequence[Features]) -> list[Proposal]:
        """The same for several robots."""
        return [self._clear(proposal) for proposal in self._method.propose_all(seen)]

    def _clear(self, proposal: Proposal) -> Proposal:
        command = proposal.command
        clear = self._shield(command, proposal.features.scan)
        if clear == command:
            return proposal
        call = Call.FEEDBACK if clear == STAND else proposal.choice.call
        return replace(proposal, choice=Choice(Driver.SHIELD, clear, call=call), speed=1.0)

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """As without a shield; from what the shield did nothing is learned."""
        if human is None and proposal.choice.driver == Driver.SHIELD:
            return Lesson(proposal.choice)
        return self._method.learn(proposal, human)

    def policy(self, driver: str) -> Policy:
        """Who drives from here on, to look ahead with: behind the shield."""
        if driver == Driver.SHIELD:
            return lambda features: self.propose(features).choice.action
        inner = self._method.policy(driver)
        return lambda features: self._shield(inner(features), features.scan)

    def alone(self, phase: Phase) -> Method:
        """What drives without a teacher, behind the same shield."""
        return Shielded(self._method.alone(phase), self._shield)
