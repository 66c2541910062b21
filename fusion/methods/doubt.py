"""HG-DAgger's doubt: how far an ensemble disagrees.

d(O) = ||diag Cov_b[pi_b(O)]||_2 over the ensemble's policies pi_b. The threshold tau is the mean of the last quarter
of the doubts that were logged when the human took over (Kelly et al., 2019).
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from lira.fusion.inference.ensemble import DrivingEnsemble
from lira.fusion.learning.kernel_novice import KernelNovice
from lira.fusion.learning.novice import NetworkNovice, Novice
from lira.fusion.preprocess import Features
from lira.hal.errors import ConfigError
from lira.hal.messages import FloatArray

Doubt = Callable[[Features], float]
"""d(O), in squared units of the action."""

LAST = 0.25  # the share of the log that counts


def doubt(actions: FloatArray) -> float:
    """d(O) of the actions [b, 2] that an ensemble proposes, b >= 2."""
    return float(np.linalg.norm(np.var(actions.astype(np.float64), axis=0, ddof=1)))


def threshold(doubts: Sequence[float]) -> float:
    """tau: the mean of the last quarter of the logged doubts, at least one; +inf if nobody ever took over."""
    if not doubts:
        return math.inf
    return float(np.mean(doubts[-math.ceil(LAST * len(doubts)) :]))


def doubt_of(novice: Novice) -> Doubt:
    """Return how a novice doubts: by its ensemble, or as a kernel regression by its posterior variances.

    Raises `ConfigError` for a novice that cannot.
    """
    if isinstance(novice, KernelNovice):
        return lambda features: math.hypot(*(each**2 for each in novice.deviation(features)))
    network = novice.network if isinstance(novice, NetworkNovice) else None
    if not isinstance(network, DrivingEnsemble):
        raise ConfigError("this novice cannot doubt", "Give it an ensemble, or the kernel novice.")
    return lambda features: doubt(network.opinions(features))


class DoubtLog:
    """How much the novice doubted whenever the human took over."""

    def __init__(self, doubt: Doubt) -> None:
        self.doubt = doubt
        self.doubts: list[float] = []

    def take_over(self, features: Features) -> None:
        """Note the doubt at the moment of a take-over."""
        self.doubts.append(self.doubt(features))

    @property
    def threshold(self) -> float:
        """tau so far."""
        return threshold(self.doubts)

    def exceeds(self, features: Features) -> bool:
        """Whether the doubt is above tau."""
        return self.doubt(features) > self.threshold
