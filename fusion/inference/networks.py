"""Networks as they drive: their weights, and the forward pass in numpy, one observation at a time.

What trains is in `policies/networks.py`, in torch, with weights of the same names; a test holds both to the same
actions.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lira.fusion.inference.architecture import Architecture, Weights, check
from lira.fusion.inference.layers import Dense
from lira.fusion.inference.trunks import Trunk, trunk_with
from lira.fusion.preprocess import Features
from lira.hal.messages import Action, FloatArray

REMEMBERED = 64  # actions: twice as many as the steps that any teacher looks ahead


class DrivingNet(ABC):
    """A network as it drives: `features` is what its trunks make of what is seen, and `act` what follows from it."""

    def __init__(self, architecture: Architecture, weights: Mapping[str, NDArray[Any]]) -> None:
        """Raises `ValueError` for weights that do not fit or are not finite."""
        self.architecture = architecture
        self._joined = np.empty(sum(architecture.trunk_sizes), np.float32)
        self.load_weights(weights)

    def __reduce__(self) -> tuple[type, tuple[Architecture, Weights]]:
        return type(self), (self.architecture, self._weights)  # what it has prepared belongs to a process

    @property
    def kind(self) -> str:
        """The sensor whose expert it is, "fusion" or "kernel"."""
        return self.architecture.kind

    def weights(self) -> Weights:
        """Its weights by name, not to be written to."""
        return dict(self._weights)

    def load_weights(self, weights: Mapping[str, NDArray[Any]]) -> None:
        """Put weights in, all or none. Raises `ValueError` where they do not fit or are not finite."""
        check(self.architecture.weights, weights)
        self._weights: Weights = {name: array.copy() for name, array in weights.items()}
        self._trunks: dict[str, Trunk] = {
            name: trunk_with(self.architecture.shapes[name], self._below(trunk))
            for name, trunk in self.architecture.trunks.items()
        }
        self._prepare(self._weights)

    def features(self, seen: Features) -> FloatArray:
        """What the trunks make of an observation [size], one behind the other; the next call writes over it."""
        return np.concatenate([trunk(seen[name]) for name, trunk in self._trunks.items()], out=self._joined)

    @abstractmethod
    def act(self, seen: Features) -> Action:
        """Return the action for one step, in [-1, 1]^2."""

    def act_all(self, seen: Sequence[Features]) -> list[Action]:
        """Return the actions for one step of several robots."""
        return [self.act(each) for each in seen]

    @abstractmethod
    def _prepare(self, weights: Weights) -> None:
        """Make what `act` needs."""

    def _below(self, trunk: str) -> Weights:
        """The weights of a trunk, called as they are within it."""
        start = f"{trunk}."
        return {name.removeprefix(start): array for name, array in self._weights.items() if name.startswith(start)}


class LayeredNet(DrivingNet):
    """An expert (trunk -> FC 2) or the thesis's novice (trunks -> 128 -> 128 -> 2), tanh at the end.

    It remembers what it did lately: a teacher who looks ahead with it asks what the robot will ask some steps later.
    """

    def act(self, seen: Features) -> Action:
        """Return the action for one step, in [-1, 1]^2."""
        what = b"".join([seen[name].tobytes() for name in self._trunks])
        action = self._lately.get(what)
        if action is None:
            linear, angular = self.head(self.features(seen)).tolist()
            if len(self._lately) >= REMEMBERED:
                self._lately.clear()  # at once, which no other thread can see half done
            action = self._lately[what] = linear, angular
        return action

    def head(self, features: FloatArray) -> FloatArray:
        """The layers behind the trunks: what those have made [size] -> the action [2]."""
        x = features
        for layer in self._layers:
            x = layer(x)
        return np.tanh(x)

    def act_all(self, seen: Sequence[Features]) -> list[Action]:
        """Ask the layers behind the trunks once: what takes long is to read their weights."""
        x = np.empty((len(seen), self._joined.size), np.float32)
        for row, each in zip(x, seen, strict=True):
            row[:] = self.features(each)
        for layer in self._layers:
            x = layer.all(x)
        return [(linear, angular) for linear, angular in np.tanh(x).tolist()]

    def _prepare(self, weights: Weights) -> None:
        self._lately: dict[bytes, Action] = {}  # by what was seen
        names = self.architecture.layers
        self._layers = [
            Dense(weights[f"{name}.weight"], weights[f"{name}.bias"], rectified=name != names[-1]) for name in names
        ]
