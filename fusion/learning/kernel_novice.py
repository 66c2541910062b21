"""The novice of `policies/kernel.py`: it learns from each label at once, and says how sure it is."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from lira.fusion.inference.kernel_net import ANGULAR, NEVER, QUIET, Doubles, KernelNet
from lira.fusion.learning.labels import Label, mirror
from lira.fusion.learning.learned_policy import Contradiction, Part, Together
from lira.fusion.learning.novice import LearningSettings, Novice
from lira.fusion.policies.kernel import KernelRidge, KernelSettings
from lira.fusion.preprocess import Features
from lira.hal.messages import Action, Driver, FloatArray

ROUNDING = 1e-4  # of what a file holds in single precision: where it was proven it is not to doubt
AGREED = 0.75  # share of the human's turns to the side of the first expert, from which on that one is asked
MOST_MET = 4096  # states that wait to be measured: 26 MB with 800 examples


class KernelNovice(Novice):
    """Kernel ridge regression on what the experts' trunks see; `mirrored` learns left and right exchanged, too."""

    def __init__(
        self, network: KernelNet, learning: LearningSettings, settings: KernelSettings, *, mirrored: bool
    ) -> None:
        super().__init__(learning)
        self._network = network
        sees = network.architecture
        self._settings = settings
        self._first = next(iter(sees.trunks.values()))  # the name of its first expert
        self._mirrored = mirrored
        self._given: list[tuple[str, Action]] = []  # who gave each label, and what it says
        self._group = 0
        self._limit = math.inf
        self._agreed: list[bool] = []  # whether a human's label turns to the side of the first expert, who spoke alone
        self._met: list[Doubles] = []  # k [n] of states of its proving runs that `limit` does not know yet
        self.ridge = KernelRidge(dict(zip(sees.shapes, sees.trunk_sizes, strict=True)), settings)

    def act(self, features: Features) -> Action:
        """m(x)."""
        return self.ridge.act(self._x(features))

    def alone(self, features: Features) -> Action:
        """m(x) with the turn times g, and with its first expert's advice."""
        (action,) = self._alone([features], proving=False)
        return action

    def proving(self, features: Features) -> Action:
        """The same. What it meets in the runs that prove it, it knows: the measure of its doubt afterwards."""
        (action,) = self._alone([features], proving=True)
        return action

    def together(self, *, proving: bool) -> Together:
        """The same of several states."""
        return partial(self._alone, proving=proving)

    @property
    def limit(self) -> float:
        """The largest deviation of its turn in the proving runs since the last label; infinite if it drove none."""
        if self._met:
            self._measure_doubt()
        return self._limit

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
        if not self._given or self._given[-1][0] != label.source:
            self._group += 1
        human, own = label.source == Driver.HUMAN, label.source == self._first
        if human and abs(label.action[ANGULAR]) >= QUIET and (side := self._network.advice(label.features).side):
            self._agreed.append(label.action[ANGULAR] * side > 0.0)
        for each in (label, mirror(label)) if self._mirrored else (label,):
            x = self._x(each.features)
            self.ridge.add(x, each.action, each.weight, human=human, own=own, group=self._group, label=self.stored)
        self._given.append((label.source, label.action))
        self.stored += 1
        self.training_steps += 1
        self._met, self._limit = [], math.inf

    def set_aside(self) -> list[Contradiction]:
        """Labels that contradict the rest, with what the others say there."""
        found = []
        for number, example in self.ridge.aside.items():
            source, action = self._given[number]
            linear, angular = self.ridge.act(self.ridge.x[example])
            mirrored = float(self.ridge.y[example, ANGULAR]) != action[ANGULAR]
            found.append(Contradiction(number, source, action, (linear, -angular if mirrored else angular), mirrored))
        return found

    def explain(self, features: Features) -> list[Part]:
        """m(x) = w(x)^T Y by labels: that of a label and that of its mirror image are added."""
        x = self._x(features)
        likeness, shares = self.ridge.k(x), self.ridge.shares(x)
        parts = []
        for number in sorted(set(self.ridge.labels.tolist())):
            of_label = self.ridge.labels == number
            linear, angular = shares[of_label].sum(axis=0).tolist()
            source, action = self._given[number]
            parts.append(Part(number, source, action, (linear, angular), float(likeness[of_label].max())))
        return sorted(parts, key=lambda part: -max(map(abs, part.share)))

    def frozen(self) -> KernelNet:
        """Return the network that drives alone: without what was set aside."""
        used, settings = self.ridge.fit.used, self._settings
        weights = self._network.weights() | {
            "x": self.ridge.x[used],
            "y": self.ridge.y[used].astype(np.float32),
            "noise": (settings.noise / self.ridge.w[used]).astype(np.float32),
            "lengths": self.ridge.lengths.astype(np.float32),
            "scale": self.ridge.fit.scale.astype(np.float32),
            "gain": np.array([self.ridge.gain], np.float32),
            "limit": np.array([min((1.0 + ROUNDING) * self.limit, NEVER)], np.float32),
        }
        if self._network.architecture.asks:
            weights["others"] = (~self.ridge.own[used]).astype(np.float32)
        return KernelNet(replace(self._network.architecture, examples=int(used.sum()), sides=self.takes_sides), weights)

    @property
    def takes_sides(self) -> bool:
        """Whether it turns to its first expert's side where it is undecided: the human's labels say so of that one."""
        return sum(self._agreed) >= AGREED * len(self._agreed) > 0.0

    def _alone(self, seen: Sequence[Features], *, proving: bool) -> list[Action]:
        # In pairs: a trunk remembers what it saw last.
        looks = [(self._x(each), self._network.advice(each)) for each in seen]
        x = np.array([each for each, _ in looks])
        what = self._network.architecture
        advice = [each for _, each in looks] if what.fallback else None
        likeness = self.ridge.k(x if len(seen) > 1 else x[0]).reshape(len(seen), -1)
        if proving:
            self._meet(likeness)
        return self.ridge.actions(likeness, self.ridge.gain, advice, sides=self.takes_sides, asks=what.asks)

    def _meet(self, k: Doubles) -> None:
        """Keep the kernel values [m, n] of states of a proving run."""
        self._met.extend(k)
        if len(self._met) >= MOST_MET:
            self._measure_doubt()

    def _measure_doubt(self) -> None:
        """Take in what it has met: all at once, and only when it matters, which for most laps is never."""
        largest = float(self.ridge.fit.deviation(np.stack(self._met))[:, ANGULAR].max())
        self._limit = largest if math.isinf(self._limit) else max(self._limit, largest)
        self._met = []

    def _x(self, features: Features) -> FloatArray:
        """x [size] of one state."""
        return self._network.see(features)
