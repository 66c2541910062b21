"""Who did how much: labels by source, interventions and calls of one session."""

from collections import Counter

from fusion.method import STAND, Call, Choice, Lesson
from hal.messages import LabelCounts


class Ledger:
    """Counts over a session. An intervention is a maximal run of steps with the human in control.

    What the human drives before the first training step is the initial demonstration: its labels are counted apart,
    and it is neither an intervention nor a call.
    """

    def __init__(self) -> None:
        self.interventions = 0
        self.calls = 0
        self._given: Counter[str] = Counter()
        self._stored: Counter[str] = Counter()
        self._last = Choice("none", STAND)

    def new_episode(self) -> None:
        """A run of steps does not go on across a reset."""
        self._last = Choice("none", STAND)

    def note(self, lesson: Lesson, *, trained: bool) -> None:
        """Count one step; `trained` says whether the novice had been trained before it."""
        choice = lesson.choice
        human = choice.driver == "human"
        if trained:
            self.interventions += human and self._last.driver != "human"
            self.calls += choice.call is not Call.NONE and self._last.call is not choice.call
        if choice.label is not None:
            account = "expert" if not human else "human" if trained else "demonstration"
            self._given[account] += 1
            self._stored[account] += lesson.stored
        self._last = choice

    @property
    def labels(self) -> LabelCounts:
        """Labels so far."""
        return LabelCounts(
            given_human=self._given["human"],
            given_expert=self._given["expert"],
            stored_human=self._stored["human"],
            stored_expert=self._stored["expert"],
            demonstration=self._stored["demonstration"],
        )

    @property
    def buffer(self) -> int:
        """Labels in D^N."""
        return self._stored.total()
