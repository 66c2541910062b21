"""The novice of `fusion/kernel.py`: it learns from each label at once, and says how sure it is."""

import math
from dataclasses import replace

import torch
from torch import Tensor

from lira.fusion.inference.kernel_net import NEVER, KernelNet
from lira.fusion.learning.labels import Label, mirror
from lira.fusion.learning.novice import LearningSettings, Novice
from lira.fusion.policies.kernel import ANGULAR, KernelRidge, KernelSettings
from lira.fusion.preprocess import Features
from lira.hal.messages import Action


class KernelNovice(Novice):
    """Kernel ridge regression on what the experts' trunks see; `mirrored` learns left and right exchanged, too."""

    def __init__(
        self, network: KernelNet, learning: LearningSettings, settings: KernelSettings, *, mirrored: bool
    ) -> None:
        super().__init__(learning)
        self._network = network
        sees = network.architecture
        self._settings = settings
        self._mirrored = mirrored
        self._sources: list[str] = []
        self._group = 0
        self.limit = math.inf  # the largest deviation of its turn in the proving runs since the last label
        self.ridge = KernelRidge(dict(zip(sees.shapes, sees.trunk_sizes, strict=True)), settings)

    def act(self, features: Features) -> Action:
        """m(x)."""
        return self.ridge.act(self._x(features))

    def alone(self, features: Features) -> Action:
        """m(x) with the turn times g."""
        return self.ridge.act(self._x(features), self.ridge.gain)

    def proving(self, features: Features) -> Action:
        """The same. What it meets in the runs that prove it, it knows: the measure of its doubt afterwards."""
        _, turn = self.deviation(features)
        self.limit = turn if math.isinf(self.limit) else max(self.limit, turn)
        return self.alone(features)

    def doubts(self, features: Features) -> bool:
        """Whether it knows less here than anywhere in the runs that proved it; never, if it drove none."""
        return self.deviation(features)[ANGULAR] > self.limit

    def deviation(self, features: Features) -> Action:
        """How far m(x) is likely to be off, as a standard deviation of each action."""
        linear, angular = self.ridge.fit.deviation(self.ridge.k(self._x(features))).tolist()
        return linear, angular

    def knows(self, features: Features, share: float) -> bool:
        """Whether it is surer of its turn than it was at all but that share of the human's labels before they came."""
        return self.deviation(features)[ANGULAR] < self.ridge.fit.surprise(share)

    def remember(self, label: Label) -> None:
        """Learn a label. What one source shows in a row is a group: its labels say little about each other's worth."""
        if self._sources[-1:] != [label.source]:
            self._group += 1
        human = label.source == "human"
        for each in (label, mirror(label)) if self._mirrored else (label,):
            x = self._x(each.features)
            self.ridge.add(x, each.action, each.weight, human=human, group=self._group, label=self.stored)
        self._sources.append(label.source)
        self.stored += 1
        self.training_steps += 1
        self.limit = math.inf

    def set_aside(self) -> list[tuple[int, str]]:
        """Number, in the order in which they were stored, and source of the labels that contradict the rest."""
        return [(number, self._sources[number]) for number in self.ridge.aside]

    def frozen(self) -> KernelNet:
        """Return the network that drives alone: without what was set aside."""
        used, settings = self.ridge.fit.used, self._settings
        weights = self._network.weights() | {
            "x": self.ridge.x[used].numpy(),
            "y": self.ridge.y[used].float().numpy(),
            "noise": (settings.noise / self.ridge.w[used]).float().numpy(),
            "lengths": torch.tensor(self.ridge.lengths).numpy(),
            "scale": self.ridge.fit.scale.float().numpy(),
            "gain": torch.tensor([self.ridge.gain]).numpy(),
            "limit": torch.tensor([min(self.limit, NEVER)]).numpy(),
        }
        return KernelNet(replace(self._network.architecture, examples=int(used.sum())), weights)

    def _x(self, features: Features) -> Tensor:
        """x [size] of one state."""
        return torch.from_numpy(self._network.see(features))
