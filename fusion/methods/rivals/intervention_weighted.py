"""Intervention-weighted regression: IWR (Mandlekar et al., 2020, arXiv 2012.06733) and Sirius (Liu et al., RSS 2023).

The human gates, as in HG-DAgger, and what the robot did between two interventions is learned as well, since nobody
minded. There is far more of that, so IWR draws half of each batch from the interventions. Sirius adds that the steps
just before an intervention count nothing: there the robot went wrong.

Half and half is kept here by what is stored: as many of the robot's own steps as the human has given labels, drawn
evenly from the stretch before the intervention. What is learned from is the same in the mean, and any novice can. They
are in no label log, which holds what others showed: a run that goes on draws new ones.
"""

import numpy as np

from lira.fusion.learning.labels import Label
from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import Lesson, Method, Proposal
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.methods.rivals.hg_dagger import HgDagger
from lira.hal.messages import Action, Driver

OWN = Driver.NOVICE  # the source of such a label


class InterventionWeightedSettings(MethodSettings, frozen=True, tag="intervention-weighted"):
    """`before_s`: how long before an intervention the robot's own steps are not to be repeated; 0 is IWR."""

    before_s: float = 0.0

    def build(self, context: Context) -> Method:
        """Teach a novice."""
        return InterventionWeighted(context.novice(), round(self.before_s / context.period_s), context.seed)


class InterventionWeighted(HgDagger):
    """HG-DAgger that learns what was left alone, too. `before`: so many steps before a take-over are not learned."""

    def __init__(self, novice: Novice, before: int, seed: int) -> None:
        self._before = before
        self._random = np.random.default_rng(seed)
        super().__init__(novice)

    def reset(self) -> None:
        """Nothing of the past episode is repeated: it may have ended in a crash."""
        super().reset()
        self._stretch: list[Proposal] = []  # the robot's steps since the last intervention
        self._own: list[Proposal] = []  # those of them that may be learned, once a human gives labels

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Store the human's action, and with it one of the robot's own."""
        if human is None:
            if self.novice.trained:
                self._stretch.append(proposal)
        elif not self._human_drove:
            count = max(0, len(self._stretch) - self._before)
            self._own, self._stretch = [self._stretch[k] for k in self._random.permutation(count)], []
        lesson = super().learn(proposal, human)
        if human is not None and lesson.stored and self._own:
            self._remember(self._own.pop())
        return lesson

    def _remember(self, past: Proposal) -> None:
        """What the robot did there is redundant by definition, and yet to be learned: it is to stay so."""
        self.novice.remember(Label(past.features, past.choice.action, OWN, self.novice.weight(OWN)))
