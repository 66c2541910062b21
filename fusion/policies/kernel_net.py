"""The novice of `fusion/kernel.py` as a network that drives alone, and as a file."""

from collections.abc import Mapping
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor

from lira.fusion.policies.kernel import ANGULAR, kernel, unit
from lira.fusion.policies.networks import IMAGE_PX, CameraNet, CameraTrunk, LidarNet, LidarTrunk, Network
from lira.fusion.preprocess import Features

NEVER = 1e9  # a limit that no deviation comes to; a file holds finite numbers


class KernelNet(Network):
    """The regression when nobody teaches it any more: both experts' trunks, the examples in use, and their solution.

    Its weights are the trunks' and, for n examples, `x` [n, size], `y` [n, 2] and `noise` [n], the length scales
    [l_c, l_d], the deviations s [2] and the gain g [1], all as in `fusion/kernel.py`; and the `limit` [1], the largest
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

    def __init__(self, bins: int, filters: int, *, px: int = IMAGE_PX, examples: int = 0) -> None:
        super().__init__()
        self.camera, self.lidar = CameraTrunk(filters, px), LidarTrunk(bins)
        size = self.camera.size + self.lidar.size
        shapes = {"x": (examples, size), "y": (examples, 2), "noise": (examples,)}
        for name, shape in {**shapes, "lengths": (2,), "scale": (2,), "gain": (1,), "limit": (1,)}.items():
            self.register_buffer(name, torch.ones(shape))
        self.requires_grad_(False)
        self._solution: tuple[Tensor, Tensor] | None = None

    @classmethod
    def from_experts(cls, camera: CameraNet, lidar: LidarNet) -> "KernelNet":
        """Build one that sees as the experts do and knows nothing."""
        network = cls(lidar.trunk.bins, camera.trunk.filters, px=camera.trunk.px)
        network.camera.load_state_dict(camera.trunk.state_dict())
        network.lidar.load_state_dict(lidar.trunk.state_dict())
        return network

    def features(self, scan: Tensor, image: Tensor, /) -> Tensor:
        """x [n, size]."""
        return unit(torch.cat([self.camera(image), self.lidar(scan)], dim=1), self.camera.size)

    def head(self, features: Tensor) -> Tensor:
        """m(x), the turn times g, clipped."""
        _, a = self._solve()
        actions = (self._k(features) @ a).float() * torch.cat([torch.ones(1), self.gain])
        return actions.clamp(-1.0, 1.0)

    def deviation(self, scan: Tensor, image: Tensor) -> Tensor:
        """sd(x) [n, 2] of the mean's two actions."""
        k, (p, _) = self._k(self.features(scan, image)), self._solve()
        variance = 1.0 - torch.einsum("ni,ij,nj->n", k, p, k)
        return variance.clamp(min=0.0).sqrt()[:, None].float() * self.scale

    def doubts(self, features: Features) -> bool:
        """Whether it knows less here than anywhere in the runs that proved it."""
        with torch.inference_mode():
            scan, image = torch.from_numpy(features.scan)[None], torch.from_numpy(features.image)[None]
            return bool(self.deviation(scan, image)[0, ANGULAR] > self.limit[0])

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
        return kernel(x, self.x, self.camera.size, (float(self.lengths[0]), float(self.lengths[1])))

    def _solve(self) -> tuple[Tensor, Tensor]:
        """P and A."""
        if self._solution is None:
            p = torch.linalg.inv(self._k(self.x) + torch.diag(self.noise.double()))
            self._solution = p, p @ self.y.double()
        return self._solution
