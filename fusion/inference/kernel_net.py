"""The novice of `policies/kernel.py` as it drives alone: the regression when nobody teaches it any more."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lira.fusion.inference.architecture import KERNEL, Architecture, Weighted, Weights, trunk_weights
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.preprocess import Features
from lira.hal.messages import Action, FloatArray

NEVER = 1e9  # a limit that no deviation comes to; a file holds finite numbers
_LEAST_LENGTH = np.float32(1e-12)  # a trunk that sees nothing stays zero instead of becoming nan

Doubles = NDArray[np.float64]


class KernelNet(DrivingNet):
    """The trunks that it sees with, the examples in use, and their solution.

    Its weights are the trunks' and, for n examples, `x` [n, size], `y` [n, 2] and `noise` [n], a length scale for each
    trunk, the deviations s [2] and the gain g [1], all as in `policies/kernel.py`; and the `limit` [1], the largest
    deviation of a turn in the runs that proved it.
    """

    @classmethod
    def from_experts(cls, experts: Sequence[Weighted]) -> "KernelNet":
        """Build one that sees as the experts do and knows nothing."""
        architecture = Architecture.novice(KERNEL, experts)
        seeing = trunk_weights(experts)
        of_all = {name: np.ones(size, np.float32) for name, size in architecture.weights.items() if name not in seeing}
        return cls(architecture, seeing | of_all)

    def see(self, seen: Features) -> FloatArray:
        """x [size] of an observation."""
        return unit(self.features(seen), self._parts)

    def head(self, features: FloatArray) -> FloatArray:
        """m(x), the turn times g, clipped; `features` are what the trunks have made."""
        mean = (self._k(features) @ self._a).astype(np.float32) * self._gains
        clipped: FloatArray = np.clip(mean, np.float32(-1.0), np.float32(1.0))
        return clipped

    def deviation(self, seen: Features) -> Action:
        """sd(x) of the mean's two actions."""
        k = self._k(self.features(seen))
        linear, angular = (np.sqrt(max(0.0, 1.0 - float(k @ self._p @ k))) * self._scale).tolist()
        return linear, angular

    def doubts(self, seen: Features) -> bool:
        """Whether it knows less here than anywhere in the runs that proved it."""
        return self.deviation(seen)[1] > self._limit

    def _prepare(self, weights: Weights) -> None:
        lengths, noise = weights["lengths"], weights["noise"]
        if min(*lengths, *noise) <= 0.0:
            raise ValueError("a kernel without width or noise")
        self._x, self._widths = weights["x"], lengths.astype(np.float64) ** 2
        self._parts = parts(self.architecture.trunk_sizes)
        self._p = np.linalg.inv(kernel(self._x, self._x, self._parts, self._widths) + np.diag(noise.astype(np.float64)))
        self._a: Doubles = self._p @ weights["y"]
        self._gains = np.array([1.0, weights["gain"][0]], np.float32)
        self._scale, self._limit = weights["scale"], float(weights["limit"][0])

    def _k(self, features: FloatArray) -> Doubles:
        return kernel(self._x, unit(features, self._parts)[None], self._parts, self._widths)[:, 0]


def parts(sizes: Sequence[int]) -> list[slice]:
    """Where in x the output of each trunk is."""
    ends = np.cumsum(sizes).tolist()
    return [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]


def unit(features: FloatArray, parts: Sequence[slice]) -> FloatArray:
    """x [size] of the trunks' outputs: each part is scaled to length 1."""
    x = np.empty_like(features)
    for part in parts:
        x[part] = features[part] / max(np.sqrt(np.dot(features[part], features[part])), _LEAST_LENGTH)
    return x


def kernel(one: FloatArray, other: FloatArray, parts: Sequence[slice], widths: Doubles) -> Doubles:
    """k of all pairs [n, m] of states [n, size] and [m, size]; `widths` are the squares of the length scales."""
    exponent = np.zeros((len(one), len(other)))
    for part, width in zip(parts, widths, strict=True):
        exponent -= (1.0 - (one[:, part] @ other[:, part].T).astype(np.float64)) / width
    return np.exp(exponent, out=exponent)
