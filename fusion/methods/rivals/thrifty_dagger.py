"""ThriftyDAgger (Hoque et al., CoRL 2021, arXiv 2109.08273): it asks where it is new or risky, within a budget.

    to the person   novelty(O) > delta_h or risk(O, a^N) > beta_h
    to the robot    ||a^N - a^H||^2 < delta_r and risk(O, a^N) < beta_r

Novelty is the variance of an ensemble's actions, risk 1 - Q of a critic. The thresholds follow from one number, the
share alpha of steps in which the person may be called: delta_h and beta_h are the (1 - alpha) quantiles of what was met
lately while the robot drove, beta_r the median of the risk, delta_r the mean discrepancy on the labels.

The paper's Q is the discounted chance to reach the goal. A lap has no goal that a drive could fail to come near, so
here risk is gamma^k, k steps before a person had to take over uncalled, and 0 where nobody had to. These stretches are
short, so that the sums are learned as they came (Monte Carlo) instead of by temporal differences.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import Method, Proposal
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.methods.doubt import Doubt, doubt_of
from lira.fusion.methods.rivals.gated import RobotGated, discrepancy
from lira.fusion.preprocess import Features
from lira.hal.messages import Action

if TYPE_CHECKING:
    from lira.fusion.methods.rivals.probe import Probe

KNOWN = 50  # steps of the robot's before a quantile is one


class ThriftyDaggerSettings(MethodSettings, frozen=True, tag="thrifty-dagger"):
    """alpha, gamma, over how many of the robot's latest steps the quantiles go, and how often critic and thresholds are
    renewed, in steps that a person drives.
    """

    alpha: float = 0.01
    gamma: float = 0.8  # at 5 Hz a danger a second ahead is a risk of a third
    window: int = 500
    every: int = 10
    ensemble: int = 5

    def build(self, context: Context) -> Method:
        """Teach a novice that can doubt, with a critic beside it. Raises `ConfigError` for one that cannot doubt."""
        from lira.fusion.methods.rivals.probe import Probe

        novice = context.novice(ensemble=self.ensemble)
        return ThriftyDagger(novice, doubt_of(novice), Probe(context.seed), self)


class ThriftyDagger(RobotGated):
    """The person drives where the novice is out of its depth, but no more often than the budget says."""

    def __init__(self, novice: Novice, novelty: Doubt, risk: "Probe", settings: ThriftyDaggerSettings) -> None:
        self._novelty, self._risk, self._settings = novelty, risk, settings
        self._met: deque[tuple[float, float]] = deque(maxlen=settings.window)  # novelty and risk of the robot's steps
        self._stretch: list[tuple[Features, Action]] = []  # the robot's steps since a person drove
        self._labels: deque[tuple[Features, Action]] = deque(maxlen=settings.window)
        self._driven = 0
        self.delta_h = self.beta_h = self.beta_r = math.inf
        self.delta_r = 0.0
        super().__init__(novice)

    def reset(self) -> None:
        """A stretch does not go on across a reset; nobody had to take over in it."""
        super().reset()
        self._end_stretch(taken_over=False)

    def hands_over(self, features: Features, a_n: Action) -> bool:
        """Novelty or risk."""
        novelty, risk = self._novelty(features), self._risk.predict(features, a_n)
        self._met.append((novelty, risk))
        return novelty > self.delta_h or risk > self.beta_h

    def hands_back(self, features: Features, a_n: Action, a_h: Action) -> bool:
        """Agreement, and no more risk than usual."""
        return discrepancy(a_n, a_h) < self.delta_r and self._risk.predict(features, a_n) <= self.beta_r

    def saw(self, proposal: Proposal, human: Action | None, *, uncalled: bool) -> None:
        """Keep the robot's steps until it is known how they ended; renew critic and thresholds."""
        if human is None:
            self._stretch.append((proposal.features, proposal.novice))
            return
        self._end_stretch(taken_over=uncalled)
        self._labels.append((proposal.features, human))
        self._driven += 1
        if self._driven % self._settings.every == 0:
            self._risk.fit()
            self._renew()

    def _end_stretch(self, *, taken_over: bool) -> None:
        for k, (features, a_n) in enumerate(reversed(self._stretch)):
            self._risk.add(features, a_n, self._settings.gamma ** (k + 1) if taken_over else 0.0)
        self._stretch = []

    def _renew(self) -> None:
        """The thresholds that the budget allows."""
        errors = [discrepancy(self.novice.act(features), a_h) for features, a_h in self._labels]
        self.delta_r = float(np.mean(errors))
        if len(self._met) >= KNOWN:
            novelties, risks = zip(*self._met, strict=True)
            self.delta_h = _quantile(novelties, 1.0 - self._settings.alpha)
            self.beta_h = _quantile(risks, 1.0 - self._settings.alpha)
            self.beta_r = _quantile(risks, 0.5)


def _quantile(values: Sequence[float], share: float) -> float:
    return float(np.quantile(values, share))
