"""HG-DAgger (Kelly et al., 2019), training phase: the human gates, and only what the human drives is learned."""

from fusion.method import STAND, Call, Choice, Lesson, Policy, Proposal
from fusion.novice import Novice
from fusion.preprocess import Features
from hal.messages import Action


class HgDagger:
    """The novice drives; the human takes the wheel when the novice errs. It also trains the experts."""

    def __init__(self, novice: Novice) -> None:
        self.novice = novice

    def reset(self) -> None:
        """Nothing belongs to an episode."""

    def update(self, now_s: float) -> None:
        """Train, and adopt what training has brought."""
        self.novice.update(now_s)

    def propose(self, features: Features) -> Proposal:
        """The novice's action; before its first training step it asks the human to drive."""
        a_n = self.novice.act(features)
        if not self.novice.trained:
            return Proposal(features, Choice("human", STAND, call=Call.FEEDBACK), a_n)
        return Proposal(features, Choice("novice", a_n), a_n)

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
