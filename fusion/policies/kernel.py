"""The kernel novice: Gaussian-process regression on what the experts have learned to see.

In the symbols of this page, n being the number of examples (a label and its mirror image are two):

    x = (c, d)   a part for each sensor (c camera, d lidar): the outputs of the experts' trunks, each scaled to length 1
    k(x, x')     exp(-(1 - <c, c'>) / l_c^2 - (1 - <d, d'>) / l_d^2), and so on for more sensors: a product of Gaussian
                 kernels on spheres, each with its length scale; k(x, x) = 1
    K            k of all pairs [n, n];  N = diag(noise / w), w the weight of a label (a human's counts more);  Y [n, 2]
    P            (K + N)^-1
    A            P Y [n, 2]
    m(x)         k(x)^T A, clipped to [-1, 1]: the mean where the prior mean is zero, so unknown means to stand
    sd_j(x)      s_j sqrt(1 - k(x)^T P k(x)): the posterior deviation of action j, in the units of the action

and by the others alone (leave one out, or a whole group G out) example i is predicted in closed form:

    Y_i - m_-i   A_i / P_ii;      Y_G - m_-G = P_GG^-1 A_G with covariance P_GG^-1

Two things are set by what was left out, one group (an intervention, or what an expert did in a row) at a time:

    s_j          root mean square of the residuals over their predicted deviation: makes sd_j calibrated
    g            what the turns of the human's labels are larger than predicted, in root mean square: the mean of full
                 steer to either side is too small a turn, and a robot that drives alone makes up for it

A state is *known* if sd of the turn there is below what it was, the intervention itself left out, at all but a share of
the human's labels: it is unlike the states in which the human found that it had to be told (a conformal threshold).

Labels that contradict the others are *set aside*, not deleted: while a residual of the turn exceeds `contradicts`, the
worst one leaves the fit, an expert's before a human's.

Sources: Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), eq. 2.25, 2.26 and section 5.4.2 (eq.
5.10 to 5.12); leaving a group out: Hager (1989), Updating the Inverse of a Matrix. Appending a row or taking one out
changes P by O(n^2) work and in its place, so it is done between two steps.

k itself, and the novice as it drives when nobody teaches it any more, are in `inference/kernel_net.py`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lira.fusion.inference.kernel_net import (
    ANGULAR,
    Advice,
    Doubles,
    decided,
    kernel,
    made_up_for,
    parts,
    unknown,
    without,
)
from lira.fusion.policies.growing import Rows, Square
from lira.hal.config import Table
from lira.hal.messages import FloatArray

GAINS = (1.0, 1.7)  # bounds of g: few interventions tell little of it, and beyond this nothing was gained

Flags = NDArray[np.bool_]
Numbers = NDArray[np.int64]


class KernelSettings(Table, frozen=True):
    """Length scales, noise and what is left out; `gain` None: calibrated. `most` bounds the examples, and the time.

    How far apart a trunk puts two pictures of one way is a matter of luck in its training, three times as far in one
    expert as in another: their scale is wide, so that it suits all.
    """

    length: float = 0.4  # l of every feature's part
    lengths: tuple[tuple[str, float], ...] = (("image", 0.9), ("scan", 0.25))  # where it is another: the feature, and l
    noise: float = 0.1  # variance of a label of weight 1
    contradicts: float | None = 1.2  # residual of the turn that sets a label aside; None: none is
    gain: float | None = None
    fallback: bool = True  # alone, it asks its first expert where it knows nothing, or which way to turn
    most: int = 800


@dataclass(frozen=True)
class Fit:
    """The regression on some examples: P [n, n] with zero rows for what is set aside, Y [n, 2], both float64.

    It looks at what the regression is kept in, and so is good until the next example.
    """

    p: Doubles
    y: Doubles
    a: Doubles  # A [n, 2]
    noise: Doubles  # the diagonal of N [n]
    used: Flags  # [n]
    human: Flags  # [n]
    own: Flags  # whether it is the first expert's own [n]
    groups: Numbers  # [n]

    def mean(self, k: Doubles) -> Doubles:
        """m before it is clipped [..., 2], of the kernel values k [..., n] of some states."""
        product: Doubles = k @ self.a
        return product

    def deviation(self, k: Doubles) -> Doubles:
        """sd [..., 2]."""
        sd: Doubles = self.scale * np.sqrt(unknown(k, self.p))[..., None]
        return sd

    @cached_property
    def squares(self) -> Doubles:
        """P (y * y) [n], y being the turns: k(x)^T times it is s(x)^2."""
        product: Doubles = self.p @ self.y[:, ANGULAR] ** 2
        return product

    @cached_property
    def of_others(self) -> Doubles:
        """P' [n, n]: of the labels alone that the first expert did not give itself."""
        return without(self.p, self.used & self.own)

    @cached_property
    def left_out(self) -> tuple[Doubles, Doubles]:
        """Of each example in use, by the other groups alone: residual [n, 2] and predicted variance [n]; else nan."""
        residual, variance = np.full_like(self.y, np.nan), np.full(len(self.y), np.nan)
        for group in np.unique(self.groups[self.used]):
            members = np.flatnonzero(self.used & (self.groups == group))
            covariance = np.linalg.inv(self.p[np.ix_(members, members)])
            residual[members] = covariance @ self.a[members]
            variance[members] = covariance.diagonal()
        return residual, variance

    @cached_property
    def scale(self) -> Doubles:
        """s [2]; 1 where there is nothing to tell it by."""
        residual, variance = self.left_out
        if not self.used.any():
            return np.ones(2)
        s: Doubles = np.sqrt((residual**2 / variance[:, None])[self.used].mean(axis=0))
        return s

    @cached_property
    def gain(self) -> float:
        """g."""
        shown = self.used & self.human
        turns = self.y[shown, ANGULAR]
        predicted = np.clip(turns - self.left_out[0][shown, ANGULAR], -1.0, 1.0)
        low, high = GAINS
        small, large = float(predicted @ predicted), float(turns @ turns)
        return low if small == 0.0 else min(high, max(low, (large / small) ** 0.5))

    def surprise(self, share: float) -> float:
        """The deviation of the turn, as the other groups predict it, below which that share of the human's labels lie.

        0 where no human has labelled anything.
        """
        shown = self.used & self.human
        if not shown.any():
            return 0.0
        variance = np.maximum(0.0, (self.left_out[1] - self.noise)[shown])
        return float(self.scale[ANGULAR] * np.sqrt(np.quantile(variance, share)))


class KernelRidge:
    """Examples, and the regression on them, kept up to date one example at a time."""

    def __init__(self, sizes: Mapping[str, int], settings: KernelSettings) -> None:
        """`sizes` of the parts of x, in order, by the names of the features that they come from."""
        self._parts = parts(tuple(sizes.values()))
        self.lengths = np.array([dict(settings.lengths).get(name, settings.length) for name in sizes])
        self._settings = settings
        self._x = Rows((sum(sizes.values()),), np.float32)
        self._y = Rows((2,), np.float64)
        self._w = Rows((), np.float64)
        self._human = Rows((), np.bool_)
        self._own = Rows((), np.bool_)
        self._groups = Rows((), np.int64)
        self._labels = Rows((), np.int64)
        self._p = Square()
        self._fit: Fit | None = None
        self._asked: tuple[FloatArray, Doubles] | None = None  # x and k(x) of the last state

    def __len__(self) -> int:
        return self._y.count

    @property
    def x(self) -> FloatArray:
        """Float32 [n, size]."""
        return self._x.rows

    @property
    def y(self) -> Doubles:
        """Y, float64 [n, 2]."""
        return self._y.rows

    @property
    def w(self) -> Doubles:
        """Weights, float64 [n]."""
        return self._w.rows

    @property
    def human(self) -> Flags:
        """Whether a human gave it [n]."""
        return self._human.rows

    @property
    def own(self) -> Flags:
        """Whether it is the first expert's own [n]."""
        return self._own.rows

    @property
    def groups(self) -> Numbers:
        """Which group each belongs to [n]."""
        return self._groups.rows

    @property
    def labels(self) -> Numbers:
        """Which label each is an example of [n]."""
        return self._labels.rows

    def k(self, x: FloatArray) -> Doubles:
        """Kernel values of one state x [size] with all examples, float64 [n], or of several [m, size], [m, n].

        Of the state that was asked about last they are known: a step asks for its action, its doubt and its label.
        """
        if x.ndim > 1:
            return kernel(self.x, x, self._parts, self.lengths**2).T
        if self._asked is None or not np.array_equal(x, self._asked[0]):
            self._asked = x.copy(), kernel(self.x, x[None], self._parts, self.lengths**2)[:, 0]
        return self._asked[1]

    def add(
        self,
        x: FloatArray,
        action: tuple[float, float],
        weight: float,
        *,
        human: bool,
        group: int,
        label: int,
        own: bool = False,
    ) -> None:
        """Append one example x [size] of a label: P is bordered (Schur complement). Of too many, one has to go."""
        k = self.k(x)
        p = self._p.values
        pk = p @ k
        schur = 1.0 + self._settings.noise / weight - float(k @ pk)
        p += np.outer(pk, pk) / schur
        self._p.border(-pk / schur, 1.0 / schur)
        self._x.append(x)
        self._y.append(action)
        self._w.append(weight)
        self._human.append(human)
        self._own.append(own)
        self._groups.append(group)
        self._labels.append(label)
        self._fit = self._asked = None
        if len(self) > self._settings.most:
            self._forget()

    @property
    def fit(self) -> Fit:
        """The regression without what contradicts the rest."""
        if self._fit is None:
            used = np.ones(len(self), np.bool_)
            p, y = self._p.values, self.y
            a = p @ y
            while (worst := self._contradiction(p, a, used)) is not None:
                if p is self._p.values:
                    p = p.copy()
                leave_out(p, worst)
                used[worst] = False
                a = p @ y
            self._fit = Fit(p, y, a, self._settings.noise / self.w, used, self.human, self.own, self.groups)
        return self._fit

    @property
    def aside(self) -> dict[int, int]:
        """The labels of which an example is set aside, and the first such example of each."""
        first: dict[int, int] = {}
        for example in np.flatnonzero(~self.fit.used).tolist():
            first.setdefault(int(self.labels[example]), example)
        return first

    def shares(self, x: FloatArray) -> Doubles:
        """What each example adds to m(x) [n, 2]: m(x) = w(x)^T Y with w(x) = P k(x)."""
        return (self.fit.p @ self.k(x))[:, None] * self.y

    def act(self, x: FloatArray, gain: float = 1.0) -> tuple[float, float]:
        """m(x), the turn times `gain`, clipped."""
        (action,) = self.actions(self.k(x)[None], gain)
        return action

    def actions(
        self,
        k: Doubles,
        gain: float = 1.0,
        advice: Sequence[Advice] | None = None,
        *,
        sides: bool = False,
        asks: bool = True,
    ) -> list[tuple[float, float]]:
        """The same of several states, of which these are the kernel values [m, n].

        With the first expert's `advice` for each as `inference/kernel_net.py` tells, also on `sides`; `asks` is False
        for a novice that was proven before it asked that expert for what that one taught it.
        """
        actions = self.fit.mean(k) * (1.0, gain)
        if advice is not None:
            given = np.array([each.given for each in advice])
            w = np.where(given, unknown(k, self.fit.of_others if asks else self.fit.p), 0.0)[:, None]
            actions = (1.0 - w * asks) * actions + w * np.array([each.action for each in advice])
            turns = actions[:, ANGULAR]
            side = np.array(
                [each.side_for(turn, sides=sides) for each, turn in zip(advice, turns.tolist(), strict=True)]
            )
            turns = decided(turns, gain, k @ self.fit.squares, side)
            agree = [asks and each.agrees(turn) for each, turn in zip(advice, turns.tolist(), strict=True)]
            actions[:, ANGULAR] = turns * np.where(agree, made_up_for(unknown(k, self.fit.p)), 1.0)
        return [(clipped(linear), clipped(angular)) for linear, angular in actions.tolist()]

    @property
    def gain(self) -> float:
        """g, or what is set instead of it."""
        return self.fit.gain if self._settings.gain is None else self._settings.gain

    def _contradiction(self, p: Doubles, a: Doubles, used: Flags) -> int | None:
        """The example that is to be set aside next."""
        limit = self._settings.contradicts
        if limit is None or not used.any():
            return None
        residual = np.zeros(len(self))
        residual[used] = np.abs(a[used, ANGULAR] / p.diagonal()[used])
        experts = np.where(self.human, 0.0, residual)
        worst = experts if experts.max() > limit else residual
        return int(worst.argmax()) if worst.max() > limit else None

    def _forget(self) -> None:
        """Let the example go that the others say best, an expert's if there is any: the log still has it."""
        p = self._p.values
        residual = ((p @ self.y / p.diagonal()[:, None]) ** 2).sum(axis=1)
        if not self.human.all():
            residual[self.human] = np.inf
        gone = int(residual.argmin())
        leave_out(p, gone)
        for kept in (self._p, self._x, self._y, self._w, self._human, self._own, self._groups, self._labels):
            kept.remove(gone)


def leave_out(p: Doubles, i: int) -> None:
    """Turn P, in place, into that of all examples but i, whose row and column become zero."""
    row = p[i].copy()
    p -= np.outer(row, row) / row[i]
    p[i], p[:, i] = 0.0, 0.0


def clipped(value: float) -> float:
    """Within the range of actions."""
    return min(1.0, max(-1.0, value))
