"""LazyDAgger (Hoque et al., CASE 2021, arXiv 2104.00053): few switches between robot and person, by a hysteresis.

    to the person   f(O) > 1/2, where f is a classifier of ||a^N - a^H||^2 > beta_H
    to the robot    ||a^N - a^H||^2 < beta_R, which can be measured as long as the person drives; beta_R < beta_H

f is trained on states that the novice was not trained on: in the paper a part of the labels is held out for that; here
each step that a person drives is judged with the novice that had not learned it yet, so that no label is lost. Its
noise on the person's commands is left out: nothing here changes what a hand commands.
"""

from typing import TYPE_CHECKING

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import Method, Proposal
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.methods.rivals.gated import RobotGated, discrepancy
from lira.fusion.preprocess import Features
from lira.hal.messages import Action

if TYPE_CHECKING:
    from lira.fusion.methods.rivals.probe import Probe


class LazyDaggerSettings(MethodSettings, frozen=True, tag="lazy-dagger"):
    """beta_H and beta_R, in squared units of the action, one tenth as in the paper; f is trained every so many steps
    that a person drives.
    """

    beta_h: float = 0.25
    beta_r: float = 0.025
    every: int = 10

    def build(self, context: Context) -> Method:
        """Teach a novice with a classifier beside it."""
        from lira.fusion.methods.rivals.probe import Probe

        return LazyDagger(context.novice(), Probe(context.seed), self)


class LazyDagger(RobotGated):
    """The person drives from where the novice is expected to differ until it does not."""

    def __init__(self, novice: Novice, f: "Probe", settings: LazyDaggerSettings) -> None:
        self._f, self._settings = f, settings
        self._seen = 0
        super().__init__(novice)

    def hands_over(self, features: Features, a_n: Action) -> bool:
        """f(O) > 1/2."""
        return self._f.predict(features, a_n) > 0.5

    def hands_back(self, features: Features, a_n: Action, a_h: Action) -> bool:  # noqa: ARG002
        """Whether they agree."""
        return discrepancy(a_n, a_h) < self._settings.beta_r

    def saw(self, proposal: Proposal, human: Action | None, *, uncalled: bool) -> None:  # noqa: ARG002
        """Judge the novice by what a person did."""
        if human is None:
            return
        differs = discrepancy(proposal.novice, human) > self._settings.beta_h
        self._f.add(proposal.features, proposal.novice, float(differs))
        self._seen += 1
        if self._seen % self._settings.every == 0:
            self._f.fit()
