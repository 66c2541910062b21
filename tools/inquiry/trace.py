"""A recorded method's calls, as `fusion.log.method_trace` told them: one list for each method that was built."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import msgspec

from lira.fusion.log.method_trace import Decided, Learned, State
from lira.hal.bus.topics import METHOD
from lira.hal.errors import CodecError, StorageError
from lira.hal.messages import Action, CallName, MethodCall, Phase
from lira.tools.recording.reader import Recorded, Recording
from lira.tools.runs.plan import Recipe

T = TypeVar("T")


@dataclass(slots=True)
class Trace:
    """What one method was asked, from its beginning. `missing` counts messages of calls that were not recorded.

    `began_s` is when the recording began, on the robot's clock.
    """

    recipe: Recipe
    began_s: float = 0.0
    calls: list[MethodCall] = field(default_factory=list)
    missing: int = 0

    @property
    def seconds(self) -> float:
        """How much of the robot's time it covers."""
        times = [call.time_s for call in self.calls if call.name is CallName.UPDATE]
        return times[-1] - times[0] if times else 0.0


def read_traces(recording: Recording) -> list[Trace]:
    """Read the calls of every method in a recording. Raises `StorageError` if there is none, or not its beginning."""
    traces: list[Trace] = []
    for each, missing in _in_order(recording):
        for call in each.message.calls:
            if call.name is CallName.BEGIN:
                traces.append(Trace(recipe_of(call), recording.head.began_s))
            if not traces:
                what = f"{recording.path} begins in the middle of a run"
                raise StorageError(what, "Record from before the learner starts: lira fusion does so by itself.")
            traces[-1].calls.append(call)
        if traces:
            traces[-1].missing += missing
    if not traces:
        what = f"nobody learns in {recording.path}"
        raise StorageError(what, "Record a run of lira fusion, lira teach or lira demo.")
    return traces


def _in_order(recording: Recording) -> Iterator[tuple[Recorded, int]]:
    """Yield the messages, with how many are missing before each."""
    due: dict[int, int] = {}
    for each in recording.messages(METHOD):
        sent = each.attachment
        missing = 0
        if sent is not None:
            missing = max(0, sent.seq - due.get(sent.epoch, sent.seq))
            due[sent.epoch] = sent.seq + 1
        yield each, missing


def recipe_of(call: MethodCall) -> Recipe:
    """Read what a method was built from. Raises `StorageError`."""
    try:
        return msgspec.json.decode(call.argument, type=Recipe)
    except msgspec.MsgspecError as error:
        what = f"what the method was built from is not understood: {error}"
        raise StorageError(what, "It was recorded by another version: go through it with that one.") from error


# What comes of a call; of the others it shows in these.
OUTCOMES: dict[CallName, type] = {
    CallName.BEGIN: State,
    CallName.UPDATE: State,
    CallName.PROPOSE: Decided,
    CallName.LEARN: Learned,
    CallName.RESET: State,
    CallName.END: State,
}


def outcome_of(call: MethodCall, kind: type[T]) -> T:
    """Read what came of a call. Raises `CodecError`."""
    try:
        return msgspec.json.decode(call.outcome, type=kind)
    except msgspec.MsgspecError as error:
        raise CodecError(f"what came of '{call.name}' is not understood: {error}") from error


@dataclass(slots=True)
class Step:
    """One pass of the loop: when, whose turn it was, what was proposed, what was learned if anything was.

    `fresh`: an episode begins with it. `human` is the person's action, and `chosen` an expert to whom a person gave
    control. `adopted` is the novice if it has changed since the step before.
    """

    time_s: float
    phase: Phase
    fresh: bool = False
    number: int = -1  # of the call that proposed, in the trace
    decided: Decided | None = None
    learned: Learned | None = None
    human: Action | None = None
    chosen: str = ""
    adopted: State | None = None


def steps_of(calls: Sequence[MethodCall], outcomes: Mapping[int, object] | None = None) -> list[Step]:
    """Put calls together to steps; with `outcomes` (by number of the call) it is those that came of them."""
    steps: list[Step] = []
    phases, fresh = {0: Phase.TRAIN}, False
    for number, call in enumerate(calls):
        outcome = outcomes.get(number) if outcomes is not None else _recorded(call)
        match call.name:
            case CallName.ALONE:
                phases[len(phases)] = Phase(call.argument)
            case CallName.RESET:
                fresh = True
            case CallName.UPDATE:
                adopted = outcome if isinstance(outcome, State) else None
                steps.append(Step(call.time_s, phases.get(call.target, Phase.PROVE), fresh, adopted=adopted))
                fresh = False
            case CallName.PROPOSE if steps and isinstance(outcome, Decided):
                steps[-1].number, steps[-1].decided = number, outcome
            case CallName.CHOOSE if steps:
                steps[-1].chosen = call.argument
            case CallName.LEARN if steps and isinstance(outcome, Learned):
                steps[-1].learned, steps[-1].human = outcome, call.action
    return steps


def _recorded(call: MethodCall) -> object:
    return outcome_of(call, OUTCOMES[call.name]) if call.outcome and call.name in OUTCOMES else None
