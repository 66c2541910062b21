"""Appendix D: reading the human's intention. Whose actions a take-over was like goes on driving for a while.

R is the short-term buffer: at every step of a take-over what the human did, and what every expert and the novice would
have done. An expert whose mean squared error is the least, and less than T^2, drives for u steps, and what it does is
learned. A press of the human cancels that.

`flexible` compares when the human lets go, `fixed` after two human steps: it then asks for control. Nothing here can
take control from a hand: who does not let go drives on.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from lira.fusion.methods.base import Around, Choice, Lesson, Method, Proposal
from lira.fusion.methods.lira import LiraSpf
from lira.fusion.preprocess import Features
from lira.hal.config import Table
from lira.hal.errors import ConfigError
from lira.hal.messages import Action, Call

Example = tuple[Action, Sequence[Action], Action]
"""One step of a take-over: a^H, a^1..a^n, a^N."""


class SharingSettings(Table, frozen=True):
    """When the human's actions are compared, and how long the expert that they were like drives."""

    when: Literal["fixed", "flexible"]
    steps: int = 10  # u (assumed)
    fixed_steps: int = 2  # human steps after which `fixed` compares

    def around(self, method: Method) -> Method:
        """Add it to LIRA-SPF. Raises `ConfigError` for another method."""
        if not isinstance(method, LiraSpf):
            raise ConfigError("the shared feedback goes with LIRA-SPF only", "Leave out `sharing`.")
        return SharedFeedback(method, self)


def similar_expert(r: Sequence[Example], limit: float) -> int | None:
    """FeedbackSimilarity: the expert nearer to the human than any other and the novice, and nearer than `limit`."""
    human = np.array([a_h for a_h, _, _ in r])
    others = np.array([[*experts, a_n] for _, experts, a_n in r])  # [steps, n + 1, 2], the novice last
    error = ((others - human[:, None]) ** 2).mean(axis=(0, 2))
    nearest = int(error.argmin())
    return nearest if nearest < error.size - 1 and error[nearest] < limit else None


class SharedFeedback(Around):
    """LIRA-SPF, and after a take-over the expert that the human drove like."""

    def __init__(self, lira: LiraSpf, settings: SharingSettings) -> None:
        super().__init__(lira)
        self._settings = settings
        self._limit = (lira.settings.consensus * lira.settings.action_range) ** 2
        self.reset()

    def reset(self) -> None:
        """R is empty, and nobody has priority."""
        self._method.reset()
        self._r: list[Example] = []
        self._expert: int | None = None  # who has priority
        self._left = 0

    def propose(self, features: Features) -> Proposal:
        """The expert with priority, if there is one, else what LIRA-SPF decides."""
        proposal = self._method.propose(features)
        if self._expert is None or not self.novice.trained:
            return proposal
        view = proposal.experts[self._expert]
        choice = Choice(view.name, view.action, label=view.action, call=Call.ATTENTION)
        return replace(proposal, choice=choice, speed=1.0, relieves=bool(self._r))

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Learn as LIRA-SPF does, and read the intention of whoever drove."""
        lesson = self._method.learn(proposal, human)
        if human is not None:
            self._watch(proposal, human)
        else:
            self._follow()
        return lesson

    def _watch(self, proposal: Proposal, human: Action) -> None:
        if not self.novice.trained:  # the initial demonstration answers nothing
            return
        if not self._r:  # a press
            self._expert = None
        self._r.append((human, [view.action for view in proposal.experts], proposal.novice))
        if self._settings.when == "fixed" and len(self._r) == self._settings.fixed_steps:
            self._give_priority()

    def _follow(self) -> None:
        """The human does not drive: a take-over has just ended, or an expert may have priority."""
        if self._r and self._settings.when == "flexible":
            self._give_priority()
        elif self._expert is not None:
            self._left -= 1
            if self._left == 0:
                self._expert = None
        self._r = []

    def _give_priority(self) -> None:
        self._expert = similar_expert(self._r, self._limit)
        self._left = self._settings.steps
