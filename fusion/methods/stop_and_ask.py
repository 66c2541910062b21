"""The robot that stops and asks where it doubts, whatever its doubt is."""

from collections.abc import Callable

from lira.fusion.methods.base import STAND, Choice, Method, Policy, Proposal
from lira.fusion.preprocess import Features
from lira.hal.messages import Action, Call, Driver


class Doubtful(Method):
    """A novice alone; where it `doubts` too much it stands and asks. Nothing is learned from the answer."""

    def __init__(self, novice: Policy, doubts: Callable[[Features], bool]) -> None:
        self._novice = novice
        self._doubts = doubts

    def propose(self, features: Features) -> Proposal:
        """The novice's action, or to stand and call for feedback."""
        a_n = self._novice(features)
        if self._doubts(features):
            return Proposal(features, Choice(Driver.NOVICE, STAND, call=Call.FEEDBACK), a_n)
        return Proposal(features, Choice(Driver.NOVICE, a_n), a_n)

    def policy(self, driver: str) -> Policy:
        """What would drive from here on, standing included."""
        return dict[str, Policy]({Driver.NOVICE: self._act})[driver]

    def _act(self, features: Features) -> Action:
        return self.propose(features).choice.action
