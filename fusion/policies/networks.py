"""The three networks of Appendix B: camera, lidar, and the fusion of both.

Leaky ReLU with slope 0.3, valid padding, Glorot initialisation, tanh outputs. All three take both sensors, so that
whoever drives or trains one need not know which it is; an expert looks at its own sensor only.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import leaky_relu, max_pool2d

from lira.hal.messages import Action, FloatArray

SLOPE = 0.3
HIDDEN = 64  # units of a lidar layer
FUSION_HIDDEN = 128
IMAGE_PX = 32

Kind = Literal["camera", "lidar", "fusion", "kernel"]
Weights = dict[str, NDArray[np.float32]]
"""All parameters of a network by name, detached from it."""


class CameraTrunk(nn.Module):
    """conv3x3(f) -> conv3x3(f) -> maxpool 2. Image float32 [n, px, px] -> [n, size].

    `reduced_precision`: convolve in bfloat16, which trains twice as fast on a processor that has it.
    """

    def __init__(self, filters: int, px: int) -> None:
        super().__init__()
        self.filters, self.px = filters, px
        self.reduced_precision = False
        self.conv1 = nn.Conv2d(1, filters, 3)
        self.conv2 = nn.Conv2d(filters, filters, 3)
        self.size = filters * ((px - 4) // 2) ** 2
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, image: Tensor) -> Tensor:
        """Return the features of a batch of images."""
        with torch.autocast("cpu", torch.bfloat16, enabled=self.reduced_precision):
            hidden = leaky_relu(self.conv1(image.unsqueeze(1)), SLOPE, inplace=True)
            # Pooled before the rectifier: it is monotonic, so the result is the same for a quarter of the work.
            return leaky_relu(max_pool2d(self.conv2(hidden), 2), SLOPE, inplace=True).flatten(1).float()


class LidarTrunk(nn.Module):
    """64 -> 64. Scan float32 [n, bins] -> [n, 64]."""

    def __init__(self, bins: int) -> None:
        super().__init__()
        self.bins = bins
        self.fc1 = nn.Linear(bins, HIDDEN)
        self.fc2 = nn.Linear(HIDDEN, HIDDEN)
        self.size = HIDDEN

    def forward(self, scan: Tensor) -> Tensor:
        """Return the features of a batch of scans."""
        return leaky_relu(self.fc2(leaky_relu(self.fc1(scan), SLOPE)), SLOPE)


class Network(nn.Module, ABC):
    """A policy: `features` is the trunk's output, `head` turns it into actions [n, 2] in [-1, 1]."""

    kind: ClassVar[Kind]

    @property
    def examples(self) -> int:
        """How many labels it drives by; 0 for one that has only been trained on them."""
        return 0

    @abstractmethod
    def features(self, scan: Tensor, image: Tensor, /) -> Tensor:
        """Scan float32 [n, bins] and image float32 [n, px, px] -> trunk output [n, size]."""

    @abstractmethod
    def head(self, features: Tensor) -> Tensor:
        """Trunk output [n, size] -> actions [n, 2]."""

    def forward(self, scan: Tensor, image: Tensor) -> Tensor:
        """Scan float32 [n, bins] and image float32 [n, px, px] -> actions [n, 2]."""
        return self.head(self.features(scan, image))

    def act(self, scan: FloatArray, image: FloatArray) -> Action:
        """Return the action for one step: scan float32 [bins], image float32 [px, px]."""
        with torch.inference_mode():
            linear, angular = self(torch.from_numpy(scan)[None], torch.from_numpy(image)[None])[0].tolist()
        return linear, angular

    def weights(self) -> Weights:
        """Copy the weights out."""
        return {name: tensor.numpy(force=True).copy() for name, tensor in self.state_dict().items()}

    def load_weights(self, weights: Mapping[str, NDArray[Any]]) -> None:
        """Put weights in, all or none. Raises `ValueError` where they do not fit or are not finite."""
        own: dict[str, Tensor] = self.state_dict()
        if own.keys() != weights.keys():
            raise ValueError(f"weights of another network: {', '.join(sorted(own.keys() ^ weights.keys()))}")
        for name, tensor in own.items():
            new = weights[name]
            if new.shape != tuple(tensor.shape) or new.dtype != np.float32:
                raise ValueError(f"{name} is {new.dtype} {new.shape} instead of float32 {tuple(tensor.shape)}")
            if not np.isfinite(new).all():
                raise ValueError(f"{name} is not finite")
        for name, tensor in own.items():
            tensor.copy_(torch.from_numpy(weights[name]))


class CameraNet(Network):
    """The camera expert: its trunk -> FC 2."""

    kind = "camera"

    def __init__(self, filters: int, *, px: int = IMAGE_PX, seed: int = 0) -> None:
        super().__init__()
        self.trunk = CameraTrunk(filters, px)
        self.out = nn.Linear(self.trunk.size, 2)
        initialise(self, seed)

    def features(self, _scan: Tensor, image: Tensor, /) -> Tensor:
        """Look at the image only."""
        return self.trunk(image)  # type: ignore[no-any-return]

    def head(self, features: Tensor) -> Tensor:
        """FC 2."""
        return torch.tanh(self.out(features))


class LidarNet(Network):
    """The lidar expert: its trunk -> FC 2."""

    kind = "lidar"

    def __init__(self, bins: int, *, seed: int = 0) -> None:
        super().__init__()
        self.trunk = LidarTrunk(bins)
        self.out = nn.Linear(self.trunk.size, 2)
        initialise(self, seed)

    def features(self, scan: Tensor, _image: Tensor, /) -> Tensor:
        """Look at the scan only."""
        return self.trunk(scan)  # type: ignore[no-any-return]

    def head(self, features: Tensor) -> Tensor:
        """FC 2."""
        return torch.tanh(self.out(features))


class FusionNet(Network):
    """The novice: both trunks, concatenated -> 128 -> 128 -> 2."""

    kind = "fusion"

    def __init__(self, bins: int, filters: int, *, px: int = IMAGE_PX, seed: int = 0) -> None:
        super().__init__()
        self.camera = CameraTrunk(filters, px)
        self.lidar = LidarTrunk(bins)
        self.fc1 = nn.Linear(self.camera.size + self.lidar.size, FUSION_HIDDEN)
        self.fc2 = nn.Linear(FUSION_HIDDEN, FUSION_HIDDEN)
        self.out = nn.Linear(FUSION_HIDDEN, 2)
        initialise(self, seed)

    @classmethod
    def from_experts(cls, camera: CameraNet, lidar: LidarNet, *, seed: int = 0) -> "FusionNet":
        """Build a novice whose trunks are copies of the experts' trunks. The learner can keep them frozen."""
        network = cls(lidar.trunk.bins, camera.trunk.filters, px=camera.trunk.px, seed=seed)
        network.camera.load_state_dict(camera.trunk.state_dict())
        network.lidar.load_state_dict(lidar.trunk.state_dict())
        return network

    def trunk(self, scan: Tensor, image: Tensor) -> Tensor:
        """Both trunks, concatenated: camera first."""
        return torch.cat([self.camera(image), self.lidar(scan)], dim=1)

    def features(self, scan: Tensor, image: Tensor, /) -> Tensor:
        """Look at both sensors."""
        return self.trunk(scan, image)

    def head(self, features: Tensor) -> Tensor:
        """128 -> 128 -> 2: the fusion layers, all that trains when the trunks are frozen."""
        hidden = leaky_relu(self.fc2(leaky_relu(self.fc1(features), SLOPE)), SLOPE)
        return torch.tanh(self.out(hidden))


def initialise(network: nn.Module, seed: int) -> None:
    """Glorot uniform weights and zero biases from a stream of their own."""
    generator = torch.Generator().manual_seed(seed)
    for layer in network.modules():
        if isinstance(layer, nn.Conv2d | nn.Linear):
            nn.init.xavier_uniform_(layer.weight, generator=generator)
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]
