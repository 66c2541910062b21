"""HG-DAgger (Kelly et al., 2019): the human gates, and only what the human drives is learned.

At test time the novice may doubt: `fusion/doubt.py`.
"""

from typing import Literal

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import STAND, Call, Choice, Lesson, Policy, Proposal
from lira.fusion.methods.doubt import DoubtLog
from lira.fusion.preprocess import Features
from lira.hal.config import Table
from lira.hal.messages import Action


class HgDaggerSettings(Table, frozen=True, tag="hg-dagger"):
    """In which runs the novice, driving alone, stops when it is in doubt, and how many policies it asks about that.

    Without any there is no ensemble. With one the novice learns what it learns without.
    """

    doubt: tuple[Literal["prove", "unseen"], ...] = ()
    ensemble: int = 5


class HgDagger:
    """The novice drives; the human takes the wheel when the novice errs. It also trains the experts.

    `log`, if there is one, notes how much the novice doubted whenever the human took over.
    """

    def __init__(self, novice: Novice, log: DoubtLog | None = None) -> None:
        self.novice = novice
        self.log = log
        self.reset()

    def reset(self) -> None:
        """Nobody holds the wheel when an episode begins."""
        self._human_drove = False

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
        taken_over = human is not None and not self._human_drove
        self._human_drove = human is not None
        if human is None:
            return Lesson(proposal.choice)
        if taken_over and self.log is not None and self.novice.trained:
            self.log.take_over(proposal.features)
        if self.novice.leaves_out(human):
            return Lesson(Choice("human", human))
        stored = self.novice.learn(proposal.features, human, "human", proposal.novice)
        return Lesson(Choice("human", human, label=human), stored)

    def policy(self, driver: str) -> Policy:
        """The novice is the only policy."""
        return {"novice": self.novice.act}[driver]
