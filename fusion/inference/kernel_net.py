"""The novice of `policies/kernel.py` as it drives alone: the regression when nobody teaches it any more.

Where all experts but the first are quiet, it asks that one, as far as nobody else has shown it what to do. With a_1
what that expert does, and P' as P, of the labels alone that it did not give itself, since those say no more than it
does, it does

    (1 - w(x)) g m(x) + w(x) a_1,    w(x) = 1 - k(x)^T P' k(x)

so that it does not lose a line only because nobody has shown it this one. Where another has something to say and nobody
has shown it whom to follow, it is as slow as it knows little. Where that one would turn to the same side, it turns as
far as what it knows says, or creeping on it would still run into what it turns away from: if it knows less than half,
1 - u(x) = k(x)^T P k(x) < 1/2, its turn is larger by the factor (2 (1 - u(x)))^-1/2.

Labels that say full steer to either side, before a box straight ahead or where the line is just out of view, have a
mean that says neither. How large a turn they say, whichever side, is

    s(x) = sqrt(k(x)^T P (y * y))                           y [n] the turns of the labels

and where that is larger than the turn above, it turns by g s(x) to the side that the first expert says, if all others
are quiet and that one is not. It does so if the human's labels say that this is the side to turn to: at least three of
four of those given where the first expert alone had something to say.

An expert that has learned left and right exchanged is quiet, too, before a box straight ahead: it *hesitates*, as is
found by asking it again with the left half of its view free of anything, and with the right. Where it has something to
say to either, the novice gets no advice, and where its labels are undecided it turns by g s(x) to the side to which it
turns itself, however little.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lira.fusion.inference.architecture import KERNEL, Architecture, Weighted, Weights, head_weights, trunk_weights
from lira.fusion.inference.layers import Dense
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.preprocess import MODALITIES, Features
from lira.hal.messages import Action, FloatArray

QUIET = 0.2  # an expert less than this away from its cruise action has nothing to say, as with `hold` of LIRA-SPF
LITTLE = 0.5  # it knows less than half: its turn is made up for
NOTHING = 1e-3  # where it knows less than this its turn is made up for as if it were this: it fades
UNDECIDED = 0.2  # so much larger a turn to either side than their mean: labels are not of one mind
NEVER = 1e9  # a limit that no deviation comes to; a file holds finite numbers
_LEAST_LENGTH = np.float32(1e-12)  # a trunk that sees nothing stays zero instead of becoming nan

ANGULAR = 1  # of an action's two numbers

Doubles = NDArray[np.float64]


class Advice(NamedTuple):
    """What the first expert says where all others are quiet; nothing, where one of them hesitates, or is not.

    Of one that is not, the side to which it turns.
    """

    action: FloatArray  # a_1 [2], or zero
    side: float = 0.0  # of its turn, -1 or 1, or 0 if it does about what it does while cruising
    given: bool = False  # it says that, so all others are quiet
    hesitation: bool = False  # one of the others is quiet only because it has as much to say for either side
    other: float = 0.0  # the side to which the one of the others turns that turns most, if it has something to say

    def side_for(self, turn: float, *, sides: bool) -> float:
        """The side to turn to, -1 or 1, if labels whose mean is `turn` are undecided; 0 for none, a_1's on `sides`."""
        own = -1.0 if turn < 0.0 else 1.0
        return own if self.hesitation else self.side * sides

    def agrees(self, turn: float) -> bool:
        """Whether another expert, that has something to say, turns to the side of this turn, too."""
        return turn * self.other > 0.0


SILENCE = Advice(np.zeros(2, np.float32))
HESITATION = SILENCE._replace(hesitation=True)


class KernelNet(DrivingNet):
    """The trunks that it sees with, the examples in use, and their solution.

    Its weights are the trunks' and, for n examples, `x` [n, size], `y` [n, 2] and `noise` [n], a length scale for each
    trunk, the deviations s [2] and the gain g [1], all as in `policies/kernel.py`; and the `limit` [1], the largest
    deviation of a turn in the runs that proved it. One that falls back also has its experts' last layers and their
    `cruise` actions [experts, 2]; one that asks the first of them has `others` [n], 1 for an example that this one did
    not give, else 0.
    """

    @classmethod
    def from_experts(cls, experts: Sequence[Weighted], cruises: Sequence[Action] | None = None) -> "KernelNet":
        """Build one that sees as the experts do and knows nothing; with their `cruises` it falls back on them."""
        asks = cruises is not None
        architecture = replace(Architecture.novice(KERNEL, experts), fallback=asks, halves=asks, asks=asks)
        theirs = trunk_weights(experts)
        if cruises is not None:
            theirs |= head_weights(experts) | {"cruise": np.array(cruises, np.float32)}
        of_all = {name: np.ones(size, np.float32) for name, size in architecture.weights.items() if name not in theirs}
        return cls(architecture, theirs | of_all)

    def see(self, seen: Features) -> FloatArray:
        """x [size] of an observation."""
        return unit(self.features(seen), self._parts)

    def advice(self, seen: Features) -> Advice:
        """What its first expert says of an observation; nothing for one that does not ask."""
        return self._advice(seen, self.features(seen))

    def act(self, seen: Features) -> Action:
        """m(x), the turn times g, with its first expert's advice, clipped."""
        features = self.features(seen)
        k, advice = self._k(features), self._advice(seen, features)
        action = (k @ self._a).astype(np.float32) * self._gains
        if advice.given:
            w = np.float32(unknown(k, self._of_others))
            action = (np.float32(1.0) - w if self.architecture.asks else 1.0) * action + w * advice.action
        side = advice.side_for(action[ANGULAR], sides=self.architecture.sides)
        action[ANGULAR] = decided(action[ANGULAR], self._gains[ANGULAR], k @ self._squares, side)
        if self.architecture.asks and advice.agrees(action[ANGULAR]):
            action[ANGULAR] *= made_up_for(unknown(k, self._p))
        linear, angular = np.clip(action, np.float32(-1.0), np.float32(1.0)).tolist()
        return linear, angular

    def deviation(self, seen: Features) -> Action:
        """sd(x) of the mean's two actions."""
        k = self._k(self.features(seen))
        linear, angular = (np.sqrt(unknown(k, self._p)) * self._scale).tolist()
        return linear, angular

    def doubts(self, seen: Features) -> bool:
        """Whether it knows less here than anywhere in the runs that proved it."""
        return self.deviation(seen)[1] > self._limit

    @property
    def proven(self) -> bool:
        """Whether it was proven after its last label: without that it never doubts."""
        return self._limit < NEVER

    def _prepare(self, weights: Weights) -> None:
        lengths, noise = weights["lengths"], weights["noise"]
        if min(lengths.min(), noise.min(initial=1.0)) <= 0.0:
            raise ValueError("a kernel without width or noise")
        self._x, self._widths = weights["x"], lengths.astype(np.float64) ** 2
        self._parts = parts(self.architecture.trunk_sizes)
        covariance = kernel(self._x, self._x, self._parts, self._widths) + np.diag(noise.astype(np.float64))
        self._p = np.linalg.inv(covariance)
        self._a: Doubles = self._p @ weights["y"]
        self._squares: Doubles = self._p @ weights["y"][:, ANGULAR] ** 2
        self._of_others = without(self._p, weights["others"] < 1.0) if self.architecture.asks else self._p
        self._gains = np.array([1.0, weights["gain"][0]], np.float32)
        self._scale, self._limit = weights["scale"], float(weights["limit"][0])
        self._heads: list[Dense] = []
        if self.architecture.fallback:
            self._cruises = weights["cruise"]
            self._heads = [
                Dense(weights[f"{trunk}_out.weight"], weights[f"{trunk}_out.bias"], rectified=False)
                for trunk in self.architecture.trunks.values()
            ]

    def _advice(self, seen: Features, features: FloatArray) -> Advice:
        if not self._heads:
            return SILENCE
        actions = [np.tanh(head(features[part])) for head, part in zip(self._heads, self._parts, strict=True)]
        away = np.array(actions) - self._cruises
        if np.abs(away[1:]).max(initial=0.0) >= QUIET:
            return SILENCE._replace(other=side_of(max(away[1:, ANGULAR].tolist(), key=abs)))
        if self.architecture.halves and self._hesitation(seen):
            return HESITATION
        return Advice(actions[0], side_of(float(away[0, ANGULAR])), given=True)

    def _hesitation(self, seen: Features) -> bool:
        """Whether one of the others has something to say as soon as half of its view is free."""
        others = list(zip(self._trunks.items(), self._heads, self._cruises, strict=True))[1:]
        return any(
            np.abs(np.tanh(head(trunk.glance(half))) - cruise).max() >= QUIET
            for (name, trunk), head, cruise in others
            for half in MODALITIES[name].halves(seen[name])
        )

    def _k(self, features: FloatArray) -> Doubles:
        return kernel(self._x, unit(features, self._parts)[None], self._parts, self._widths)[:, 0]


def side_of(turn: float) -> float:
    """The side of an expert's turn, -1 or 1; 0 if it has nothing to say."""
    return math.copysign(1.0, turn) if abs(turn) >= QUIET else 0.0


def parts(sizes: Sequence[int]) -> list[slice]:
    """Where in x the output of each trunk is."""
    ends = np.cumsum(sizes).tolist()
    return [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]


def decided(turn: NDArray[Any], gain: float, squares: NDArray[Any], side: NDArray[Any] | float) -> NDArray[Any]:
    """The turn [...], or g s(x) to that side where this is much more; `squares` are those of s(x)."""
    size = gain * np.sqrt(np.maximum(squares, 0.0))
    undecided = (size > np.abs(turn) + UNDECIDED) & np.not_equal(side, 0.0)
    return np.where(undecided, side * size, turn)


def made_up_for(share: NDArray[Any]) -> NDArray[Any]:
    """How much larger the turn is where that share [...] is unknown and another expert agrees with its side."""
    factor: NDArray[Any] = np.sqrt(LITTLE / np.clip(1.0 - share, NOTHING, LITTLE))
    return factor


def without(p: NDArray[Any], gone: NDArray[np.bool_]) -> Doubles:
    """P [n, n] of the examples that are not `gone` [n]; the rows of those are zero."""
    rows = p[:, gone]
    left: Doubles = p - rows @ np.linalg.solve(p[np.ix_(gone, gone)], rows.T)
    return left


def unknown(k: Doubles, p: NDArray[Any]) -> Doubles:
    """1 - k(x)^T P k(x), the posterior variance where s is 1: of one state k [n], or of several [m, n], [m]."""
    known: Doubles = (k @ p * k).sum(axis=-1)
    return np.maximum(0.0, 1.0 - known)


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
