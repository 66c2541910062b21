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
changes P by O(n^2) work, so it is done between two steps.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor
from torch.nn.functional import normalize, pad

from lira.hal.config import Table

LINEAR, ANGULAR = 0, 1
GAINS = (1.0, 1.7)  # bounds of g: few interventions tell little of it, and beyond this nothing was gained


class KernelSettings(Table, frozen=True):
    """Length scales, noise and what is left out; `gain` None: calibrated. `most` bounds the examples, and the time."""

    length: float = 0.4  # l of every feature's part
    lengths: tuple[tuple[str, float], ...] = ()  # of those where it is another: the feature's name, and l
    noise: float = 0.1  # variance of a label of weight 1
    contradicts: float | None = 1.2  # residual of the turn that sets a label aside; None: none is
    gain: float | None = None
    most: int = 800


def unit(features: Tensor, sizes: Sequence[int]) -> Tensor:
    """x [n, size] of the trunks' outputs [n, size], parts of these sizes: each is scaled to length 1."""
    return torch.cat([normalize(part) for part in torch.split(features, list(sizes), dim=1)], dim=1)


def kernel(one: Tensor, other: Tensor, sizes: Sequence[int], lengths: Sequence[float]) -> Tensor:
    """k of all pairs, float64 [n, m], of states [n, size] and [m, size]; a size and a length scale for each part."""
    exponent = torch.zeros(len(one), len(other), dtype=torch.float64)
    parts = zip(torch.split(one, list(sizes), dim=1), torch.split(other, list(sizes), dim=1), lengths, strict=True)
    for mine, theirs, length in parts:
        exponent -= (1.0 - (mine @ theirs.T).double()) / length**2
    return exponent.exp()


@dataclass(frozen=True)
class Fit:
    """The regression on some examples: P float64 [n, n] with zero rows for what is set aside, Y float64 [n, 2]."""

    p: Tensor
    y: Tensor
    noise: Tensor  # the diagonal of N [n]
    used: Tensor  # bool [n]
    human: Tensor  # bool [n]
    groups: Tensor  # int64 [n]

    @cached_property
    def a(self) -> Tensor:
        """A [n, 2]."""
        return self.p @ self.y

    def mean(self, k: Tensor) -> Tensor:
        """m before it is clipped [2], of the kernel values k [n] of one state."""
        return k @ self.a

    def deviation(self, k: Tensor) -> Tensor:
        """sd [2]."""
        variance: Tensor = 1.0 - k @ self.p @ k
        return self.scale * variance.clamp(min=0.0).sqrt()

    @cached_property
    def left_out(self) -> tuple[Tensor, Tensor]:
        """Of each example in use, by the other groups alone: residual [n, 2] and predicted variance [n]; else nan."""
        residual, variance = torch.full_like(self.y, torch.nan), torch.full_like(self.y[:, 0], torch.nan)
        for group in sorted(set(self.groups[self.used].tolist())):
            members = torch.nonzero(self.used & (self.groups == group))[:, 0]
            covariance = torch.linalg.inv(self.p[members][:, members])
            residual[members] = covariance @ self.a[members]
            variance[members] = covariance.diagonal()
        return residual, variance

    @cached_property
    def scale(self) -> Tensor:
        """s [2]; 1 where there is nothing to tell it by."""
        residual, variance = self.left_out
        if not self.used.any():
            return torch.ones(2, dtype=torch.float64)
        return (residual.square() / variance[:, None])[self.used].mean(dim=0).sqrt()

    @cached_property
    def gain(self) -> float:
        """g."""
        shown = self.used & self.human
        turns = self.y[shown, ANGULAR]
        predicted = (turns - self.left_out[0][shown, ANGULAR]).clamp(-1.0, 1.0)
        low, high = GAINS
        small, large = float(predicted.square().sum()), float(turns.square().sum())
        return low if small == 0.0 else min(high, max(low, (large / small) ** 0.5))

    def surprise(self, share: float) -> float:
        """The deviation of the turn, as the other groups predict it, below which that share of the human's labels lie.

        0 where no human has labelled anything.
        """
        shown = self.used & self.human
        if not shown.any():
            return 0.0
        variance = (self.left_out[1] - self.noise)[shown].clamp(min=0.0)
        return float(self.scale[ANGULAR] * variance.quantile(share).sqrt())


class KernelRidge:
    """Examples, and the regression on them, kept up to date one example at a time."""

    def __init__(self, sizes: Mapping[str, int], settings: KernelSettings) -> None:
        """`sizes` of the parts of x, in order, by the names of the features that they come from."""
        self._sizes = tuple(sizes.values())
        self.lengths = tuple(dict(settings.lengths).get(name, settings.length) for name in sizes)
        self._settings = settings
        self.x = torch.empty(0, sum(self._sizes))  # float32 [n, size]
        self.y = torch.empty(0, 2, dtype=torch.float64)
        self.w = torch.empty(0, dtype=torch.float64)
        self.human = torch.empty(0, dtype=torch.bool)
        self.groups = torch.empty(0, dtype=torch.int64)
        self.labels = torch.empty(0, dtype=torch.int64)  # which label each is an example of
        self._p = torch.empty(0, 0, dtype=torch.float64)
        self._fit: Fit | None = None

    def __len__(self) -> int:
        return len(self.y)

    def k(self, x: Tensor) -> Tensor:
        """Kernel values of one state x [size] with all examples, float64 [n]."""
        return kernel(self.x, x[None], self._sizes, self.lengths)[:, 0]

    def add(
        self, x: Tensor, action: tuple[float, float], weight: float, *, human: bool, group: int, label: int
    ) -> None:
        """Append one example x [size] of a label: P is bordered (Schur complement). Of too many, one has to go."""
        k = self.k(x)
        pk = self._p @ k
        schur = 1.0 + self._settings.noise / weight - k @ pk
        row = torch.cat([-pk, torch.ones(1, dtype=torch.float64)])
        self._p = pad(self._p, (0, 1, 0, 1)) + torch.outer(row, row) / schur
        self.x = torch.cat([self.x, x[None]])
        self.y = torch.cat([self.y, torch.tensor([action], dtype=torch.float64)])
        self.w = torch.cat([self.w, torch.tensor([weight], dtype=torch.float64)])
        self.human = torch.cat([self.human, torch.tensor([human])])
        self.groups = torch.cat([self.groups, torch.tensor([group])])
        self.labels = torch.cat([self.labels, torch.tensor([label])])
        self._fit = None
        if len(self) > self._settings.most:
            self._forget()

    @property
    def fit(self) -> Fit:
        """The regression without what contradicts the rest."""
        if self._fit is None:
            used = torch.ones(len(self), dtype=torch.bool)
            p = self._p.clone()
            while (worst := self._contradiction(p, used)) is not None:
                leave_out(p, worst)
                used[worst] = False
            self._fit = Fit(p, self.y, self._settings.noise / self.w, used, self.human, self.groups)
        return self._fit

    @property
    def aside(self) -> dict[int, int]:
        """The labels of which an example is set aside, and the first such example of each."""
        first: dict[int, int] = {}
        for example in torch.nonzero(~self.fit.used)[:, 0].tolist():
            first.setdefault(int(self.labels[example]), example)
        return first

    def shares(self, x: Tensor) -> Tensor:
        """What each example adds to m(x) [n, 2]: m(x) = w(x)^T Y with w(x) = P k(x)."""
        return (self.fit.p @ self.k(x))[:, None] * self.y

    def act(self, x: Tensor, gain: float = 1.0) -> tuple[float, float]:
        """m(x), the turn times `gain`, clipped."""
        linear, angular = self.fit.mean(self.k(x)).tolist()
        return clipped(linear), clipped(gain * angular)

    @property
    def gain(self) -> float:
        """g, or what is set instead of it."""
        return self.fit.gain if self._settings.gain is None else self._settings.gain

    def _contradiction(self, p: Tensor, used: Tensor) -> int | None:
        """The example that is to be set aside next."""
        limit = self._settings.contradicts
        if limit is None or not used.any():
            return None
        residual = ((p @ self.y[:, ANGULAR]) / p.diagonal()).abs().where(used, 0.0)
        experts = residual.where(~self.human, 0.0)
        worst = experts if float(experts.max()) > limit else residual
        return int(worst.argmax()) if float(worst.max()) > limit else None

    def _forget(self) -> None:
        """Let the example go that the others say best, an expert's if there is any: the log still has it."""
        residual = ((self._p @ self.y) / self._p.diagonal()[:, None]).square().sum(dim=1)
        if not self.human.all():
            residual = residual.where(~self.human, torch.inf)
        gone = int(residual.argmin())
        stay = torch.arange(len(self)) != gone
        leave_out(self._p, gone)
        self._p = self._p[stay][:, stay]
        self.x, self.y, self.w = self.x[stay], self.y[stay], self.w[stay]
        self.human, self.groups, self.labels = self.human[stay], self.groups[stay], self.labels[stay]


def leave_out(p: Tensor, i: int) -> None:
    """Turn P, in place, into that of all examples but i, whose row and column become zero."""
    row = p[i].clone()
    p.addr_(row, row, alpha=-1.0 / float(row[i]))
    p[i], p[:, i] = 0.0, 0.0


def clipped(value: float) -> float:
    """Within the range of actions."""
    return min(1.0, max(-1.0, value))
