"""Robot-gated teaching: the robot says when the person shall drive, and when no longer.

The two rules are a method's own:

    hands_over(O, a^N)       asked before each step that the robot drives
    hands_back(O, a^N, a^H)  asked after each step that a called person has driven

In between the robot stands and calls until a hand drives it. Papers of this family let nobody drive uncalled; here a
person may take control at any time, as with every method, and that is learned, too: nobody lets a robot drive into a
box to see whether it asks. A hand that came uncalled goes when it likes.
"""

from abc import abstractmethod

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import ASK, STAND, Choice, Lesson, Method, Policy, Proposal
from lira.fusion.preprocess import Features
from lira.hal.messages import Action, Call, Driver


class RobotGated(Method):
    """The novice drives until a rule calls the person, who drives until a rule asks for control back."""

    novice: Novice

    def __init__(self, novice: Novice) -> None:
        self.novice = novice
        self.reset()

    def reset(self) -> None:
        """The robot drives when an episode begins."""
        self._called = False  # the person shall drive
        self._relieves = False  # the person who drives shall let go
        self._human_drove = False

    @abstractmethod
    def hands_over(self, features: Features, a_n: Action) -> bool:
        """Whether the person shall drive from here on."""

    @abstractmethod
    def hands_back(self, features: Features, a_n: Action, a_h: Action) -> bool:
        """Whether the person, who did a^H where the novice would have done a^N, is needed no longer."""

    def saw(self, proposal: Proposal, human: Action | None, *, uncalled: bool) -> None:
        """Learn about the rules' own quantities from a step; `uncalled` if a hand has just come without a call."""

    def propose(self, features: Features) -> Proposal:
        """The novice's action, or to stand and call; before its first training step the human is asked to drive."""
        a_n = self.novice.act(features)
        if not self.novice.trained:
            return Proposal(features, ASK, a_n)
        if not self._called and not self._human_drove and self.hands_over(features, a_n):
            self._called = True
        if self._called:
            return Proposal(features, Choice(Driver.NOVICE, STAND, call=Call.FEEDBACK), a_n)
        return Proposal(features, Choice(Driver.NOVICE, a_n), a_n, relieves=self._relieves)

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Store what the human did, and see whether that is enough."""
        if self.novice.trained:
            self.saw(proposal, human, uncalled=human is not None and not self._human_drove and not self._called)
        if human is not None and self._called:
            self._relieves = self.hands_back(proposal.features, proposal.novice, human)
            self._called = not self._relieves
        elif human is None:
            self._relieves = False
        self._human_drove = human is not None
        return super().learn(proposal, human)

    def policy(self, driver: str) -> Policy:
        """What would drive from here on: nobody, as long as the person is called."""
        if driver == Driver.NOVICE and self._called:
            return _stand
        return super().policy(driver)


def _stand(_: Features) -> Action:
    return STAND


def discrepancy(a: Action, b: Action) -> float:
    """||a - b||^2, as all papers of this family measure it."""
    return sum((x - y) ** 2 for x, y in zip(a, b, strict=True))
