"""What a run has proven, in words, and how sure so few laps make it."""

import math
from collections.abc import Callable, Sequence

from lira.fusion.log.run_log import UNPROVEN, ContradictionRecord, EditRecord, LapRecord, ResultRecord
from lira.hal.words import plural
from lira.tools.output.when import when

HALVINGS = 60


def share(passed: int, laps: int, level: float = 0.95) -> tuple[float, float]:
    """Interval of the pass rate behind so many passed laps: Clopper and Pearson (1934), exact and never too narrow."""
    tail = (1.0 - level) / 2.0
    low = 0.0 if passed == 0 else _root(lambda rate: _at_least(passed, laps, rate) < tail)
    high = 1.0 if passed == laps else _root(lambda rate: 1.0 - _at_least(passed + 1, laps, rate) > tail)
    return low, high


def share_words(passed: int, laps: int, what: str = "unseen layout", how: str = "") -> str:
    """Like: 12 of 12 unseen layouts; 95 %: 74 to 100 %."""
    low, high = share(passed, laps)
    return f"{passed} of {plural(laps, what)}{how}; 95 %: {100 * low:.0f} to {100 * high:.0f} %"


def proof_words(result: ResultRecord) -> str:
    """What the proving runs have shown."""
    if result.proof == UNPROVEN:
        return "taught by hand; nothing was proven: that takes lira teach"
    kind, _, count = result.proof.partition(":")
    passed, of, shown = count.partition("/")
    what = "the layout it was taught on"
    if kind == "fresh":
        fresh = plural(int(shown or passed), "fresh layout")
        what = f"{passed} of {fresh}" if of else f"{fresh} in a row"
    laps = plural(result.laps, "training lap")
    if result.converged:
        return f"proven after {laps}: the novice alone passed {what}"
    helped = result.human_labels or result.demonstration or result.interventions
    unasked = "" if helped else "; while it was taught nobody ever took over, so nobody showed it the way back"
    return f"not proven within {laps}: the novice alone did not pass {what}{unasked}"


def edit_words(edit: EditRecord) -> str:
    """What was done to a run's labels after its proof, of which that says nothing; empty where nothing was."""
    parts = [(edit.taken_back, "taken back"), (edit.learned_again, "learned again")]
    said = " and ".join(f"{plural(count, 'label')} {what}" for count, what in parts if count)
    return f"since then: {said}; the novice of what is left has not been proven" if said else ""


def unseen_words(laps: Sequence[LapRecord]) -> str:
    """How the novice drove the layouts that were shown afterwards; empty where there were none."""
    if not laps:
        return ""
    collisions, lost = sum(lap.collisions for lap in laps), sum(lap.lost for lap in laps)
    passed = share_words(sum(lap.passed for lap in laps), len(laps))
    return f"alone it passed {passed}; collisions: {collisions}, lost lines: {lost}"


def contradiction_words(found: Sequence[ContradictionRecord]) -> str:
    """Which labels the novice does not follow, for whoever gave them to look at; empty where there are none."""
    said = []
    for mirrored in (False, True):
        each = [_contradiction(one) for one in found if one.mirrored == mirrored]
        which = "this label" if len(each) == 1 else f"these {len(each)} labels"
        if mirrored:
            which = f"the mirror image{'' if len(each) == 1 else 's'} of {which}"
        does, are = ("contradicts", "is") if len(each) == 1 else ("contradict", "are")
        said += [f"{which} {does} the rest and {are} not followed: {', '.join(each)}"] if each else []
    return "; ".join(said)


def _contradiction(found: ContradictionRecord) -> str:
    """One of them, as it contradicts the others."""
    side = -1.0 if found.mirrored else 1.0
    given = "" if found.given_s is None else f", {when(found.given_s)}"
    return (
        f"{found.number} ({found.source}, lap {found.lap}{given}: "
        f"turn {side * found.action[1]:+.2f}, the others {side * found.others[1]:+.2f})"
    )


def _at_least(passed: int, laps: int, rate: float) -> float:
    """Probability of so many passed laps or more, in log space: binomial coefficients outgrow a float."""
    return sum(
        math.exp(_log_choose(laps, k) + _log(rate, k) + _log(1.0 - rate, laps - k)) for k in range(passed, laps + 1)
    )


def _log_choose(n: int, k: int) -> float:
    return math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)


def _log(rate: float, times: int) -> float:
    return times * math.log(rate) if times else 0.0


def _root(below: Callable[[float], bool]) -> float:
    """Where a condition that holds on the left of [0, 1] ceases to."""
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if below(middle) else (low, middle)
    return (low + high) / 2.0
