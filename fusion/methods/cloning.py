"""Behaviour cloning: the human shows whole laps, and the novice is trained when the lap is over. The floor.

It never drives before it is asked to prove itself, so it never sees where its own errors lead.
"""

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import STAND, Call, Choice, Lesson, Policy, Proposal
from lira.fusion.preprocess import Features
from lira.hal.config import Table
from lira.hal.messages import Action


class CloningSettings(Table, frozen=True, tag="cloning"):
    """There is nothing to set: m and the network are those of every method."""


class Cloning:
    """The human drives. As many training steps as the other methods would have done follow at the end of the lap."""

    def __init__(self, novice: Novice) -> None:
        self.novice = novice

    def reset(self) -> None:
        """A lap is over: run the training steps that are due."""
        self.novice.catch_up()

    def update(self, now_s: float) -> None:
        """Nothing is trained while the human drives."""

    def propose(self, features: Features) -> Proposal:
        """Ask the human to drive."""
        return Proposal(features, Choice("human", STAND, call=Call.FEEDBACK), self.novice.act(features))

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Store the human's action, unless it is an idle frame that is to be left out."""
        if human is None:
            return Lesson(proposal.choice)
        if self.novice.leaves_out(human):
            return Lesson(Choice("human", human))
        stored = self.novice.learn(proposal.features, human, "human", proposal.novice)
        return Lesson(Choice("human", human, label=human), stored)

    def policy(self, driver: str) -> Policy:
        """The novice is the only policy."""
        return {"novice": self.novice.act}[driver]
