"""Which labels made the novice do what it did: the run is gone through again up to that step, and the novice asked."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lira.fusion.learning.learned_policy import Part
from lira.fusion.log.method_trace import Learned
from lira.hal.messages import CallName, MethodCall
from lira.hal.profile import RobotProfile
from lira.tools.inquiry.algorithm import spoken
from lira.tools.inquiry.rerun import novice_before
from lira.tools.inquiry.trace import Trace, outcome_of

SHOWN = 5


@dataclass(frozen=True, slots=True)
class Behind:
    """One label's part in an action. `time_s` (robot's clock) is when it was given, None for one from another day."""

    part: Part
    time_s: float | None


def labels_behind(trace: Trace, profile: RobotProfile, number: int) -> list[Behind]:
    """Return the labels that made the novice's action in the call `number`, the largest part first.

    None for a novice that cannot tell: a network has no single label to name. Raises `ConfigError` as `go_again` does.
    """
    novice, seen = novice_before(trace, profile, number)
    given = label_times(trace.calls[:number])
    found = novice.explain(seen)
    return [Behind(part, given[part.number] if part.number < len(given) else None) for part in found[:SHOWN]]


def label_times(calls: Sequence[MethodCall]) -> list[float | None]:
    """When each label was given that was learned, in the order in which they were."""
    given: list[float | None] = []
    reserved: deque[float] = deque()
    now_s = 0.0
    for call in calls:
        match call.name:
            case CallName.UPDATE:
                now_s = call.time_s
            case CallName.REMEMBER:
                given.append(None)
            case CallName.RESET if call.target == 0:
                reserved.clear()
            case CallName.LEARN:
                learned = outcome_of(call, Learned)
                for kept in learned.settled:
                    time_s = reserved.popleft()
                    given += [time_s] if kept else []
                if learned.reserved:
                    reserved.append(now_s)
                given += [now_s] if learned.stored else []
    return given


def words(found: Sequence[Behind], began_s: float) -> Iterator[str]:
    """The labels, to read; times since the recording began."""
    if not found:
        yield "this novice cannot tell which labels make what it does"
    for each in found:
        part = each.part
        when = "from before" if each.time_s is None else f"at {each.time_s - began_s:.1f} s"
        likeness = f"{part.likeness:.0%} like what is seen now"
        yield f"{part.source} {when}: {spoken(part.action)}; {likeness}; its share: {spoken(part.share)}"
