"""Behaviour cloning: the human shows whole laps, and the novice is trained when the lap is over. The floor.

It never drives before it is asked to prove itself, so it never sees where its own errors lead.
"""

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import ASK, Method, Proposal
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.preprocess import Features


class CloningSettings(MethodSettings, frozen=True, tag="cloning"):
    """There is nothing to set: m and the network are those of every method."""

    def build(self, context: Context) -> Method:
        """Clone with a novice of its own."""
        return Cloning(context.novice())


class Cloning(Method):
    """The human drives. As many training steps as the other methods would have done follow at the end of the lap."""

    novice: Novice

    def __init__(self, novice: Novice) -> None:
        self.novice = novice

    def reset(self) -> None:
        """A lap is over: run the training steps that are due."""
        self.novice.catch_up()

    def update(self, now_s: float) -> None:
        """Nothing is trained while the human drives."""

    def propose(self, features: Features) -> Proposal:
        """Ask the human to drive."""
        return Proposal(features, ASK, self.novice.act(features))
