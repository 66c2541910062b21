"""The networks of Appendix B as they train: one for each sensor's expert, and the fusion of all that a novice sees.

Leaky ReLU with slope 0.3, valid padding, stride 1, Glorot initialisation, tanh outputs. Every network is asked with all
features by name, and looks at its own, so that whoever trains one need not know which they are. What drives is in
`inference/networks.py`, without torch.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Self

import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import leaky_relu, max_pool2d

from lira.fusion.inference.architecture import (
    FUSION,
    FUSION_HIDDEN,
    HIDDEN,
    Architecture,
    Weighted,
    Weights,
    check,
    trunk_weights,
)
from lira.fusion.inference.build import driving
from lira.fusion.inference.layers import SLOPE as _SLOPE
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.preprocess import MODALITIES, Features, Shape

SLOPE = float(_SLOPE)

Inputs = Mapping[str, Tensor]
"""A batch of features by name, float32 [n, *shape]."""


class PictureTrunk(nn.Module):
    """conv3x3(f) -> conv3x3(f) -> maxpool 2. Picture float32 [n, px, px] -> [n, size].

    `reduced_precision`: convolve in bfloat16, which trains twice as fast on a processor that has it.
    """

    def __init__(self, shape: Shape, filters: int) -> None:
        super().__init__()
        self.shape, self.filters = shape, filters
        self.reduced_precision = False
        self.conv1 = nn.Conv2d(1, filters, 3)
        self.conv2 = nn.Conv2d(filters, filters, 3)
        self.size = filters * ((shape[0] - 4) // 2) ** 2
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, image: Tensor) -> Tensor:
        """Return the features of a batch of pictures."""
        with torch.autocast("cpu", torch.bfloat16, enabled=self.reduced_precision):
            hidden = leaky_relu(self.conv1(image.unsqueeze(1)), SLOPE, inplace=True)
            # Pooled before the rectifier: it is monotonic, so the result is the same for a quarter of the work.
            pooled = leaky_relu(max_pool2d(self.conv2(hidden), 2), SLOPE, inplace=True)
        return _SlopeInOrder.apply(pooled).flatten(1).float()  # type: ignore[no-any-return,no-untyped-call]


class _SlopeInOrder(torch.autograd.Function):
    """A picture's features as they are. Their slope, which comes back channel by channel from what is flat, is brought
    into the order in memory that they have: with two orders the rectifier takes twenty times as long.
    """

    @staticmethod
    def forward(_: Any, pooled: Tensor) -> Tensor:
        """Features [n, filters, h, w], channels last."""
        return pooled.view_as(pooled)

    @staticmethod
    def backward(_: Any, slope: Tensor) -> Tensor:
        """Their slope, channels last, too."""
        return slope.contiguous(memory_format=torch.channels_last)


class ScanTrunk(nn.Module):
    """64 -> 64. Scan float32 [n, bins] -> [n, 64]."""

    filters = 0  # it has none

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.shape = shape
        self.fc1 = nn.Linear(shape[0], HIDDEN)
        self.fc2 = nn.Linear(HIDDEN, HIDDEN)
        self.size = HIDDEN

    def forward(self, scan: Tensor) -> Tensor:
        """Return the features of a batch of scans."""
        return leaky_relu(self.fc2(leaky_relu(self.fc1(scan), SLOPE)), SLOPE)


Trunk = PictureTrunk | ScanTrunk


def new_trunk(name: str, shape: Shape, filters: int) -> Trunk:
    """Make what looks at a feature, by its name. Raises `ValueError` for a shape that it cannot have."""
    if name not in MODALITIES:
        raise ValueError(f"a feature '{name}' that is none of {', '.join(MODALITIES)}")
    MODALITIES[name].check(shape)
    if MODALITIES[name].trunk == "scan":
        return ScanTrunk(shape)
    if filters < 1:
        raise ValueError(f"a {name} seen by a trunk without filters")
    return PictureTrunk(shape, filters)


class Network(nn.Module, ABC):
    """A policy: `features` is what its trunks make of what is seen, `head` turns that into actions [n, 2] in [-1, 1].

    `kind` is the sensor whose expert it is, or "fusion".
    """

    kind: str

    @property
    @abstractmethod
    def trunks(self) -> dict[str, Trunk]:
        """What looks at each feature, by the feature's name and in order."""

    @property
    def shapes(self) -> dict[str, Shape]:
        """The features it looks at, and their shapes."""
        return {name: trunk.shape for name, trunk in self.trunks.items()}

    @property
    def filters(self) -> int:
        """Width of the trunks that see pictures; 0 without any."""
        return max(trunk.filters for trunk in self.trunks.values())

    @property
    def architecture(self) -> Architecture:
        """What it is made of."""
        return Architecture(self.kind, self.shapes, self.filters)

    def driving(self) -> DrivingNet:
        """Return what drives with a copy of its weights."""
        return driving(self.architecture, self.weights())

    def features(self, inputs: Inputs) -> Tensor:
        """What the trunks make of a batch [n, size], one behind the other."""
        return torch.cat([trunk(inputs[name]) for name, trunk in self.trunks.items()], dim=1)

    @abstractmethod
    def head(self, features: Tensor) -> Tensor:
        """Trunk output [n, size] -> actions [n, 2]."""

    def forward(self, inputs: Inputs) -> Tensor:
        """A batch of features -> actions [n, 2]."""
        return self.head(self.features(inputs))

    def weights(self) -> Weights:
        """Copy the weights out."""
        return {name: tensor.numpy(force=True).copy() for name, tensor in self.state_dict().items()}

    def load_weights(self, weights: Mapping[str, NDArray[Any]]) -> None:
        """Put weights in, all or none. Raises `ValueError` where they do not fit or are not finite."""
        check(self.architecture.weights, weights)
        own: dict[str, Tensor] = self.state_dict()
        for name, tensor in own.items():
            tensor.copy_(torch.from_numpy(weights[name]))


class ExpertNet(Network):
    """An expert that sees one feature: its trunk -> FC 2."""

    def __init__(self, name: str, shape: Shape, filters: int = 0, *, seed: int = 0) -> None:
        super().__init__()
        self.trunk = new_trunk(name, shape, filters)
        self.out = nn.Linear(self.trunk.size, 2)
        self.sees = name
        self.kind = MODALITIES[name].sensor
        initialise(self, seed)

    @property
    def trunks(self) -> dict[str, Trunk]:
        """Its only one."""
        return {self.sees: self.trunk}

    def head(self, features: Tensor) -> Tensor:
        """FC 2."""
        return torch.tanh(self.out(features))


class SeeingNet(Network):
    """A network with a trunk for each of its features, which is called by the sensor's name."""

    def __init__(self, shapes: Mapping[str, Shape], filters: int) -> None:
        super().__init__()
        for name, shape in shapes.items():
            trunk = new_trunk(name, shape, filters)
            self.add_module(MODALITIES[name].sensor, trunk)
        self._sees = tuple(shapes)

    @property
    def trunks(self) -> dict[str, Trunk]:
        """One for each feature."""
        return {name: getattr(self, MODALITIES[name].sensor) for name in self._sees}

    def see_as(self, experts: Sequence[Weighted]) -> Self:
        """Take copies of the experts' trunks."""
        self.load_weights(self.weights() | trunk_weights(experts))
        return self


class FusionNet(SeeingNet):
    """The novice: the trunks, concatenated -> 128 -> 128 -> 2."""

    kind = FUSION

    def __init__(self, shapes: Mapping[str, Shape], filters: int, *, seed: int = 0) -> None:
        super().__init__(shapes, filters)
        self.fc1 = nn.Linear(sum(trunk.size for trunk in self.trunks.values()), FUSION_HIDDEN)
        self.fc2 = nn.Linear(FUSION_HIDDEN, FUSION_HIDDEN)
        self.out = nn.Linear(FUSION_HIDDEN, 2)
        initialise(self, seed)

    @classmethod
    def from_experts(cls, experts: Sequence[Weighted], *, frozen: bool = True, seed: int = 0) -> "FusionNet":
        """Build a novice that sees what some experts see together, if `frozen` with copies of their trunks.

        The learner can keep these as they are.
        """
        what = Architecture.novice(FUSION, experts)
        network = cls(what.shapes, what.filters, seed=seed)
        return network.see_as(experts) if frozen else network

    def head(self, features: Tensor) -> Tensor:
        """128 -> 128 -> 2: the fusion layers, all that trains when the trunks are frozen."""
        hidden = leaky_relu(self.fc2(leaky_relu(self.fc1(features), SLOPE)), SLOPE)
        return torch.tanh(self.out(hidden))


def batch_of_one(seen: Features) -> dict[str, Tensor]:
    """What was seen at one step as a batch [1, *shape] by name. The memory is shared."""
    return {name: torch.from_numpy(array)[None] for name, array in seen.items()}


def initialise(network: nn.Module, seed: int) -> None:
    """Glorot uniform weights and zero biases from a stream of their own."""
    generator = torch.Generator().manual_seed(seed)
    for layer in network.modules():
        if isinstance(layer, nn.Conv2d | nn.Linear):
            nn.init.xavier_uniform_(layer.weight, generator=generator)
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]
