"""What would have been otherwise: calls, drivers and labels of a recorded run, and of the same with other settings."""

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import msgspec

from lira.fusion.log.method_trace import Learned, State
from lira.hal.messages import Call, CallName, Driver, Phase
from lira.tools.inquiry.rerun import Again
from lira.tools.inquiry.trace import Step, outcome_of, steps_of

ASIDE = 0.1  # a turn that differs by so much of full is another one


@dataclass(slots=True)
class Side:
    """One way the teaching went, counted as `fusion.log.counts.Ledger` does: a call when it rises, no demonstration.

    Labels are by who gave them; one that is reserved counts as stored when it is decided on.
    """

    calls: Counter[str] = field(default_factory=Counter)
    called_steps: int = 0
    drivers: Counter[str] = field(default_factory=Counter)
    given: Counter[str] = field(default_factory=Counter)
    stored: Counter[str] = field(default_factory=Counter)
    _call: Call = Call.NONE
    _reserved: deque[str] = field(default_factory=deque)

    def note(self, step: Step) -> None:
        """Count one step of teaching."""
        if step.fresh:
            self._call = Call.NONE
            self._reserved.clear()
        if step.learned is None or step.decided is None:
            return
        choice = step.learned.choice
        self.drivers[choice.driver] += 1
        self._note_labels(step.learned)
        if step.decided.choice.driver != Driver.NOBODY:
            self.called_steps += choice.call is not Call.NONE
            self.calls[choice.call] += choice.call not in (Call.NONE, self._call)
            self._call = choice.call

    def _note_labels(self, learned: Learned) -> None:
        source = learned.choice.driver
        if learned.choice.label is not None:
            self.given[source] += 1
            self.stored[source] += learned.stored
        for kept in learned.settled:
            self.stored[self._reserved.popleft()] += kept
        if learned.reserved:
            self._reserved.append(source)


class Row(msgspec.Struct, frozen=True):
    """One line of the table: what is counted, how much of it there was, and how much there would have been."""

    name: str
    was: int
    now: int


class Moment(msgspec.Struct, frozen=True):
    """A step in which another would have driven, or another call have been made. Times since the recording began."""

    time_s: float
    was_driver: str
    now_driver: str
    was_call: str
    now_call: str


class Otherwise(msgspec.Struct, frozen=True):
    """The comparison: the table, and the moments of the teaching at which it shows, in order.

    `steps` were taught; `alone` were driven by the novice alone, in `aside` of which it would have turned otherwise.
    """

    rows: tuple[Row, ...]
    moments: tuple[Moment, ...]
    steps: int
    alone: int
    aside: int


def compare(again: Again) -> Otherwise:
    """Compare a run that was gone through with other settings with the one that was recorded."""
    was, now = Side(), Side()
    moments: list[Moment] = []
    steps = alone = aside = 0
    for before, after in zip(steps_of(again.trace.calls), steps_of(again.trace.calls, again.outcomes), strict=True):
        if before.decided is None or after.decided is None:
            continue
        if before.phase == Phase.TRAIN:
            steps += 1
            was.note(before)
            now.note(after)
            moments += _moment(before, after, again.trace.began_s)
        else:
            alone += 1
            aside += abs(before.decided.choice.action[1] - after.decided.choice.action[1]) > ASIDE
    ends = _last_state(again), again.final or State(0, 0)
    return Otherwise(tuple(_rows((was, now), ends, len(moments))), tuple(moments), steps, alone, aside)


def _moment(before: Step, after: Step, began_s: float) -> list[Moment]:
    assert before.decided is not None
    assert after.decided is not None
    one, other = before.decided.choice, after.decided.choice
    if (one.driver, one.call) == (other.driver, other.call):
        return []
    return [Moment(before.time_s - began_s, one.driver, other.driver, one.call, other.call)]


def _rows(sides: tuple[Side, Side], ends: tuple[State, State], moments: int) -> Iterator[Row]:
    was, now = sides
    for call in (Call.ATTENTION, Call.FEEDBACK):
        yield Row(f"calls for {call}", was.calls[call], now.calls[call])
    yield Row("steps with a call", was.called_steps, now.called_steps)
    for driver in _names(was.drivers, now.drivers):
        yield Row(f"steps driven: {driver}", was.drivers[driver], now.drivers[driver])
    for source in _names(was.given, now.given):
        yield Row(f"labels given: {source}", was.given[source], now.given[source])
        yield Row(f"labels learned: {source}", was.stored[source], now.stored[source])
    yield Row("labels learned", ends[0].labels, ends[1].labels)
    yield Row("training steps", ends[0].steps, ends[1].steps)
    yield Row("proposals that differ", 0, moments)


def _names(*counts: Counter[str]) -> Sequence[str]:
    return sorted({name for count in counts for name, many in count.items() if many})


def _last_state(again: Again) -> State:
    """The novice that was recorded last."""
    states = [
        outcome_of(call, State)
        for call in again.trace.calls
        if call.target == 0 and call.outcome and call.name in (CallName.UPDATE, CallName.RESET, CallName.END)
    ]
    return states[-1] if states else State(0, 0)
