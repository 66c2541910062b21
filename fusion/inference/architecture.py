"""What a network is made of, which says all about it but its weights: their names and shapes follow from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lira.fusion.preprocess import MODALITIES, Shape

FUSION, KERNEL = "fusion", "kernel"  # the kinds of novices
HIDDEN = 64  # units of a scan trunk's layer
FUSION_HIDDEN = 128

Weights = dict[str, NDArray[np.float32]]
"""All parameters of a network by name."""
Sizes = dict[str, Shape]
"""Their shapes."""


@dataclass(frozen=True)
class Architecture:
    """What a network is made of, which says all about it but its weights.

    `kind` is the sensor whose expert it is, "fusion" or "kernel". `shapes` are those of the features it looks at, by
    name and in order; `filters` the width of the trunks that see pictures, 0 without any. `examples` is how many a
    kernel drives by, `fallback` whether it knows what its experts do where it knows nothing itself, `halves` whether it
    asks them again with half of their view free, `asks` whether it asks the first of them itself instead of going by
    what that one taught it, and `sides` whether it turns to its side where it is undecided; `members` the size of the
    ensemble beside a novice.
    """

    kind: str
    shapes: Mapping[str, Shape]
    filters: int
    examples: int = 0
    members: int = 0
    fallback: bool = False
    halves: bool = False
    asks: bool = False
    sides: bool = False

    def __post_init__(self) -> None:
        """Raises `ValueError` for what cannot be."""
        if not self.shapes:
            raise ValueError("a network that sees nothing")
        for name, shape in self.shapes.items():
            if name not in MODALITIES:
                raise ValueError(f"a feature '{name}' that is none of {', '.join(MODALITIES)}")
            MODALITIES[name].check(shape)
            if len(shape) > 1 and self.filters < 1:
                raise ValueError(f"a {name} seen by a trunk without filters")
        if self.kind not in (FUSION, KERNEL) and [MODALITIES[name].sensor for name in self.shapes] != [self.kind]:
            raise ValueError(f"a {self.kind} network that sees {', '.join(self.shapes)}")

    @classmethod
    def novice(cls, kind: str, experts: "Sequence[Weighted]") -> "Architecture":
        """A novice that sees what some experts see together."""
        each = [expert.architecture for expert in experts]
        shapes = {name: shape for one in each for name, shape in one.shapes.items()}
        return cls(kind, shapes, max(one.filters for one in each))

    @property
    def trunks(self) -> dict[str, str]:
        """What the trunk of each feature is called among the weights."""
        alone = self.kind not in (FUSION, KERNEL)
        return {name: "trunk" if alone else MODALITIES[name].sensor for name in self.shapes}

    @property
    def trunk_sizes(self) -> tuple[int, ...]:
        """How many numbers each trunk makes of its feature."""
        return tuple(
            HIDDEN if len(shape) == 1 else self.filters * ((shape[0] - 4) // 2) ** 2 for shape in self.shapes.values()
        )

    @property
    def weights(self) -> Sizes:
        """Shapes of all its weights by name."""
        sizes: Sizes = {}
        for name, trunk in self.trunks.items():
            sizes |= {f"{trunk}.{each}": size for each, size in self._trunk(self.shapes[name]).items()}
        seen, n = sum(self.trunk_sizes), self.examples
        if self.kind == KERNEL:
            sizes |= {"x": (n, seen), "y": (n, 2), "noise": (n,), "lengths": (len(self.shapes),)}
            sizes |= {"scale": (2,), "gain": (1,), "limit": (1,)}
            if self.fallback:
                for trunk, size in zip(self.trunks.values(), self.trunk_sizes, strict=True):
                    sizes |= {f"{trunk}_out.weight": (2, size), f"{trunk}_out.bias": (2,)}
                sizes["cruise"] = (len(self.shapes), 2)
            if self.asks:
                sizes["others"] = (n,)
            return sizes
        widths = (seen, FUSION_HIDDEN, FUSION_HIDDEN, 2) if self.kind == FUSION else (seen, 2)
        for name, (before, after) in zip(self.layers, pairwise(widths), strict=True):
            sizes |= {f"{name}.weight": (after, before), f"{name}.bias": (after,)}
        for k, (before, after) in enumerate(pairwise(widths) if self.members else ()):
            sizes |= {f"member_weights.{k}": (self.members, before, after)}
            sizes |= {f"member_biases.{k}": (self.members, 1, after)}
        return sizes

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers behind the trunks."""
        return ("fc1", "fc2", "out") if self.kind == FUSION else ("out",)

    def _trunk(self, shape: Shape) -> Sizes:
        f = self.filters
        scan: Sizes = {"fc1": (HIDDEN, shape[0]), "fc2": (HIDDEN, HIDDEN)}
        layers = scan if len(shape) == 1 else {"conv1": (f, 1, 3, 3), "conv2": (f, f, 3, 3)}
        weights = {f"{name}.weight": size for name, size in layers.items()}
        return weights | {f"{name}.bias": size[:1] for name, size in layers.items()}


class Weighted(Protocol):
    """Whatever has weights and says of what: a network as it drives, or as it trains."""

    @property
    def architecture(self) -> Architecture:
        """What it is made of."""

    def weights(self) -> Weights:
        """Its weights by name."""


def trunk_weights(experts: Sequence[Weighted]) -> Weights:
    """The weights of some experts' trunks, called as those of a novice that sees with copies of them."""
    seeing: Weights = {}
    for expert in experts:
        weights = expert.weights()
        for feature, trunk in expert.architecture.trunks.items():
            sensor, start = MODALITIES[feature].sensor, f"{trunk}."
            below = {name.removeprefix(start): array for name, array in weights.items() if name.startswith(start)}
            seeing |= {f"{sensor}.{name}": array for name, array in below.items()}
    return seeing


def head_weights(experts: Sequence[Weighted]) -> Weights:
    """The weights of some experts' last layers, called as those of a novice that falls back on them."""
    heads: Weights = {}
    for expert in experts:
        (feature,), weights = expert.architecture.shapes, expert.weights()
        sensor = MODALITIES[feature].sensor
        heads |= {f"{sensor}_out.{name}": weights[f"out.{name}"] for name in ("weight", "bias")}
    return heads


def check(sizes: Sizes, weights: Mapping[str, NDArray[Any]]) -> None:
    """Raises `ValueError` for weights that are not of these shapes, or are not finite."""
    check_shapes(sizes, {name: array.shape for name, array in weights.items()})
    for name, array in weights.items():
        if array.dtype != np.float32:
            raise ValueError(f"{name} is {array.dtype} instead of float32")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} is not finite")


def check_shapes(sizes: Sizes, found: Mapping[str, Shape]) -> None:
    """Raises `ValueError` for shapes that are not these."""
    if sizes.keys() != found.keys():
        raise ValueError(f"weights of another network: {', '.join(sorted(sizes.keys() ^ found.keys()))}")
    for name, size in sizes.items():
        if found[name] != size:
            raise ValueError(f"{name} is {found[name]} instead of {size}")
