"""The novice of `policies/kernel.py` as a network that drives alone, and as a file."""

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor

from lira.fusion.policies.kernel import ANGULAR, kernel, unit
from lira.fusion.policies.networks import ExpertNet, Inputs, SeeingNet, batch_of_one, seen_by
from lira.fusion.preprocess import Features, Shape

NEVER = 1e9  # a limit that no deviation comes to; a file holds finite numbers


class KernelNet(SeeingNet):
    """The regression when nobody teaches it any more: the experts' trunks, the examples in use, and their solution.

    Its weights are the trunks' and, for n examples, `x` [n, size], `y` [n, 2] and `noise` [n], a length scale for each
    trunk, the deviations s [2] and the gain g [1], all as in `policies/kernel.py`; and the `limit` [1], the largest
    deviation of a turn in the runs that proved it.
    """

    kind = "kernel"
    x: Tensor
    y: Tensor
    noise: Tensor
    lengths: Tensor
    scale: Tensor
    gain: Tensor
    limit: Tensor

    def __init__(self, shapes: Mapping[str, Shape], filters: int, *, examples: int = 0) -> None:
        super().__init__(shapes, filters)
        of_examples = {"x": (examples, sum(self.sizes)), "y": (examples, 2), "noise": (examples,)}
        of_all = {"lengths": (len(self.sizes),), "scale": (2,), "gain": (1,), "limit": (1,)}
        for name, shape in {**of_examples, **of_all}.items():
            self.register_buffer(name, torch.ones(shape))
        self.requires_grad_(False)
        self._solution: tuple[Tensor, Tensor] | None = None

    @classmethod
    def from_experts(cls, experts: Sequence[ExpertNet]) -> "KernelNet":
        """Build one that sees as the experts do and knows nothing."""
        return cls(*seen_by(experts)).see_as(experts)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Sizes of the trunks' outputs."""
        return tuple(trunk.size for trunk in self.trunks.values())

    def features(self, inputs: Inputs) -> Tensor:
        """x [n, size]."""
        return unit(super().features(inputs), self.sizes)

    def head(self, features: Tensor) -> Tensor:
        """m(x), the turn times g, clipped."""
        _, a = self._solve()
        actions = (self._k(features) @ a).float() * torch.cat([torch.ones(1), self.gain])
        return actions.clamp(-1.0, 1.0)

    def deviation(self, inputs: Inputs) -> Tensor:
        """sd(x) [n, 2] of the mean's two actions."""
        k, (p, _) = self._k(self.features(inputs)), self._solve()
        variance = 1.0 - torch.einsum("ni,ij,nj->n", k, p, k)
        return variance.clamp(min=0.0).sqrt()[:, None].float() * self.scale

    def doubts(self, features: Features) -> bool:
        """Whether it knows less here than anywhere in the runs that proved it."""
        with torch.inference_mode():
            return bool(self.deviation(batch_of_one(features))[0, ANGULAR] > self.limit[0])

    @property
    def examples(self) -> int:
        """n."""
        return len(self.x)

    def load_weights(self, weights: Mapping[str, NDArray[Any]]) -> None:
        """Put weights in. Raises `ValueError` where they do not fit."""
        super().load_weights(weights)
        self._solution = None
        if float(torch.cat([self.lengths, self.noise]).min()) <= 0.0:
            raise ValueError("a kernel without width or noise")

    def _k(self, x: Tensor) -> Tensor:
        return kernel(x, self.x, self.sizes, self.lengths.tolist())

    def _solve(self) -> tuple[Tensor, Tensor]:
        """P and A."""
        if self._solution is None:
            p = torch.linalg.inv(self._k(self.x) + torch.diag(self.noise.double()))
            self._solution = p, p @ self.y.double()
        return self._solution
