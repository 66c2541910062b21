"""Who did how much: labels by source, interventions and calls of one session."""

from collections import Counter

import msgspec
from msgspec.structs import asdict

from lira.fusion.methods.base import Choice, Lesson
from lira.hal.messages import Call, Driver, LabelCounts

ANSWER_S = 2.0 + 1e-6  # an intervention so soon after a call belongs to it; steps fall on the very limit
DEMONSTRATION = "demonstration"


class Account(msgspec.Struct, frozen=True):
    """What teaching took, beside interventions and calls. But for `given` and `stored`: after the demonstration.

    A *call episode* is a maximal run of steps with any call. It is *answered* if an intervention begins while it lasts
    or no later than 2 s after its end: the teacher, who looks ahead with what is driving, saw it go wrong. An
    intervention is *called for* by the same rule. So precision is `answered / call_episodes` and recall
    `called_for / interventions`. A *switch* is a change of the driver. `given` and `stored` count labels by source:
    the driver who gave them, or "demonstration" (the human before the first training step).
    """

    steps: int = 0
    human_steps: int = 0
    call_steps: int = 0
    slowed_steps: int = 0  # driven slowly since feedback was called for
    switches: int = 0
    call_episodes: int = 0
    answered: int = 0
    called_for: int = 0
    given: dict[str, int] = {}
    stored: dict[str, int] = {}


NOTHING = Account()


class Ledger:
    """Counts over a session. An intervention is a maximal run of steps with the human in control.

    To give an expert control counts as one intervention and one human label.

    What the human drives before the first training step is the initial demonstration: its labels are counted apart,
    and it is neither an intervention nor a call.
    """

    def __init__(self) -> None:
        self.interventions = 0
        self.calls = 0
        self._given: Counter[str] = Counter()
        self._stored: Counter[str] = Counter()
        self._count: Counter[str] = Counter()
        self._choices = 0
        self.new_episode()

    def go_on(self, labels: LabelCounts, interventions: int, calls: int, account: Account = NOTHING) -> None:
        """Count on from where another session has ended. Labels of the `account` are those of `labels`."""
        before = ((Driver.HUMAN, "human"), (Driver.MEAN, "expert"))
        for source, name in before:
            self._given[source] += getattr(labels, f"given_{name}")
            self._stored[source] += getattr(labels, f"stored_{name}")
        self._given[DEMONSTRATION] += labels.demonstration
        self._stored[DEMONSTRATION] += labels.demonstration
        self.interventions += interventions
        self.calls += calls
        self._count.update({name: value for name, value in asdict(account).items() if isinstance(value, int)})

    def take_back(self, source: str, count: int) -> None:
        """So many stored labels of a source were taken back; the demonstration's go last."""
        taken = min(count, self._stored[source])
        self._stored[source] -= taken
        if source == Driver.HUMAN:
            self._stored[DEMONSTRATION] -= min(count - taken, self._stored[DEMONSTRATION])

    def new_episode(self) -> None:
        """A run of steps does not go on across a reset."""
        self._last: Choice | None = None
        self._unanswered: list[float] = []  # ends of the latest call episodes

    def note(self, lesson: Lesson, *, now_s: float, demonstrating: bool) -> None:
        """Count one step; `demonstrating` says whether the method had nobody to drive but the human."""
        choice = lesson.choice
        if choice.label is not None:
            source = DEMONSTRATION if demonstrating and choice.driver == Driver.HUMAN else choice.driver
            self._given[source] += 1
            self._stored[source] += lesson.stored
        for settled in lesson.settled:
            self._stored[settled.proposal.choice.driver] += settled.stored
        if not demonstrating:
            self._note_driver(choice, now_s)
            self._note_call(choice, now_s)
        self._last = choice

    def _note_driver(self, choice: Choice, now_s: float) -> None:
        human, last = choice.driver == Driver.HUMAN, self._last
        chosen = choice.given > (last.given if last is not None else 0)
        self._choices += chosen
        self._count["steps"] += 1
        self._count["human_steps"] += human
        self._count["switches"] += last is not None and last.driver != choice.driver
        if chosen or (human and (last is None or last.driver != Driver.HUMAN)):
            self.interventions += 1
            recent = sum(end_s >= now_s - ANSWER_S for end_s in self._unanswered)
            self._count["answered"] += recent
            self._count["called_for"] += recent > 0
            self._unanswered = []

    def _note_call(self, choice: Choice, now_s: float) -> None:
        if choice.call is Call.NONE:
            return
        before = Call.NONE if self._last is None else self._last.call
        self.calls += before is not choice.call
        self._count["call_steps"] += 1
        moves = choice.driver not in (Driver.HUMAN, Driver.NOBODY)
        self._count["slowed_steps"] += choice.call is Call.FEEDBACK and moves
        if before is Call.NONE or not self._unanswered:
            self._count["call_episodes"] += 1
            self._unanswered = [end_s for end_s in self._unanswered if end_s >= now_s - ANSWER_S] + [now_s]
        self._unanswered[-1] = now_s

    @property
    def labels(self) -> LabelCounts:
        """Labels so far."""
        return LabelCounts(
            given_human=self._given[Driver.HUMAN] + self._choices,
            given_expert=_experts(self._given),
            stored_human=self._stored[Driver.HUMAN] + self._choices,
            stored_expert=_experts(self._stored),
            demonstration=self._stored[DEMONSTRATION],
        )

    @property
    def buffer(self) -> int:
        """Labels in D^N."""
        return self._stored.total()

    @property
    def account(self) -> Account:
        """Everything else so far."""
        return Account(**self._count, given=dict(self._given), stored=dict(self._stored))


def _experts(counts: Counter[str]) -> int:
    return counts.total() - counts[Driver.HUMAN] - counts[DEMONSTRATION]
