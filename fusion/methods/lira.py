"""LIRA-SPF: Algorithm 1 of the thesis, in its own symbols.

Pi^1..Pi^n are the experts, Pi^N the novice, a actions in [-1, 1]^2 = (linear, angular), O the observation, S^i the last
J actions of expert i, D^N the novice's labels. Line numbers are those of Algorithm 1.

The printed algorithm asks "Pi^1 or Pi^2 is activated" before it asks for both, which makes the second branch
unreachable; the text says "a single expert", and so does `choose`.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Literal, Self

import msgspec
import numpy as np

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import ASK, Choice, Expert, Lesson, Method, Policy, Proposal
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.preprocess import Features
from lira.hal.messages import Action, Call, Driver, ExpertView


class LiraSettings(MethodSettings, frozen=True, tag="lira"):
    """The thresholds, as fractions of the action range, and what the thesis leaves open.

    `hold` (not in the thesis) also counts an expert as active while its action is further than this from its cruise
    action: an expert in a constant hard turn has no standard deviation and would fall "inactive" in mid-manoeuvre.
    """

    theta: float = 0.03  # activation threshold
    consensus: float = 0.10  # T
    action_range: float = 2.0  # high - low
    memory_s: float = 1.0  # J, in time
    slow_down: float = 0.3  # speed factor while feedback is called for (assumed)
    hold: float | None = 0.2
    start: Literal["human", "experts"] = "human"  # who drives before the first training step

    def build(self, context: Context) -> Method:
        """Teach a novice with these experts."""
        return LiraSpf(context.experts, context.novice(), self, context.period_s)

    def starting(self, who: str) -> Self:
        """Return the same with the human or the experts driving first."""
        return msgspec.convert({**msgspec.to_builtins(self), "start": who}, type(self))


PRESETS = {"hold": LiraSettings(), "thesis": LiraSettings(hold=None)}


def activation(s_i: Sequence[Action]) -> float:
    """A^i: the population standard deviation of the last J actions, summed over their dimensions (eq. 1)."""
    return sum(map(_deviation, zip(*s_i, strict=True)))


def _deviation(values: Sequence[float]) -> float:
    """Their standard deviation. As an array so few would take five times as long."""
    middle = sum(values) / len(values)
    return math.sqrt(sum((value - middle) * (value - middle) for value in values) / len(values))


def in_consensus(actions: Sequence[Action], threshold: float) -> bool:
    """Whether every |a^i_k - a^j_k| < T over all pairs (eq. 2)."""
    pairs = combinations(actions, 2)
    return all(abs(i - j) < threshold for one, other in pairs for i, j in zip(one, other, strict=True))


def mean(actions: Sequence[Action]) -> Action:
    """Mean action."""
    linear, angular = np.mean(np.asarray(actions), axis=0)
    return float(linear), float(angular)


def choose(human: Action | None, experts: Sequence[ExpertView], a_n: Action, threshold: float) -> Choice:
    """Lines 7 to 23: who drives, what is learned, and who is called."""
    active = [expert for expert in experts if expert.active]
    if human is not None:  # lines 7 to 9
        return Choice(Driver.HUMAN, human, label=human)
    if not active:  # lines 22, 23
        return Choice(Driver.NOVICE, a_n)
    if len(active) == 1:  # lines 10 to 13
        return Choice(active[0].name, active[0].action, label=active[0].action, call=Call.ATTENTION)
    actions = [expert.action for expert in active]
    if in_consensus(actions, threshold):  # lines 14 to 18
        return Choice(Driver.MEAN, mean(actions), label=mean(actions))
    return Choice(Driver.NOVICE, a_n, call=Call.FEEDBACK)  # lines 19 to 21; slowed down


class LiraSpf(Method):
    """Learning Interactively to Resolve Ambiguity in Sensor Policy Fusion. Line 25 is `Method.update`."""

    novice: Novice

    def __init__(self, experts: Sequence[Expert], novice: Novice, settings: LiraSettings, period_s: float) -> None:
        if len(experts) < 2:
            raise ValueError("LIRA-SPF needs at least two experts")
        self.experts = experts
        self.novice = novice
        self.settings = settings
        self._j = max(2, round(settings.memory_s / period_s))
        self.reset()

    def reset(self) -> None:
        """Line 1: S is empty, so nobody is active until it holds J actions."""
        self._s: list[deque[Action]] = [deque(maxlen=self._j) for _ in self.experts]

    def propose(self, features: Features) -> Proposal:
        """Lines 3 to 6 and 10 to 23: what to execute unless the human gives feedback."""
        a = [expert.act(features) for expert in self.experts]  # line 4
        a_n = self.novice.act(features)
        for s_i, a_i in zip(self._s, a, strict=True):  # line 5, also while the human drives
            s_i.append(a_i)
        views = tuple(self._view(*each) for each in zip(self.experts, self._s, a, strict=True))  # line 6
        choice = choose(None, views, a_n, self._consensus) if self.novice.trained else self._beginning(a)
        speed = self.settings.slow_down if choice.call is Call.FEEDBACK else 1.0
        return Proposal(features, choice, a_n, views, self._theta, speed)

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Lines 7 to 9, and the labels of lines 13 and 18."""
        choice = proposal.choice
        if human is not None:
            choice = choose(human, proposal.experts, proposal.novice, self._consensus)
            if self.novice.leaves_out(human):
                choice = replace(choice, label=None)
        if choice.label is None:
            return Lesson(choice)
        return Lesson(choice, self.novice.learn(proposal.features, choice.label, choice.driver, proposal.novice))

    def policy(self, driver: str) -> Policy:
        """The policy behind a driver's name."""
        if driver == Driver.MEAN:
            return self._mean_of_all
        return super().policy(driver)

    def _mean_of_all(self, features: Features) -> Action:
        return mean([expert.act(features) for expert in self.experts])

    @property
    def _theta(self) -> float:
        return self.settings.theta * self.settings.action_range

    @property
    def _consensus(self) -> float:
        return self.settings.consensus * self.settings.action_range

    def _view(self, expert: Expert, s_i: Sequence[Action], a_i: Action) -> ExpertView:
        """Line 6: an expert is active if its actions change, or if it holds one away from its cruise."""
        full = len(s_i) == self._j
        strength = activation(s_i) if full else 0.0
        hold = self.settings.hold
        holds = hold is not None and not in_consensus([a_i, expert.cruise], hold)
        return ExpertView(expert.name, a_i, strength, full and (strength > self._theta or holds))

    def _beginning(self, a: Sequence[Action]) -> Choice:
        """Before the first training step the novice knows nothing: the human is asked to drive."""
        if self.settings.start == "experts":
            return Choice(Driver.MEAN, mean(a), label=mean(a))
        return ASK
