"""What a trial's journal says: how soon it stood, how far it went, what it obeyed, and whether it moved unasked. Pure.

Whose motion the wheels had, and how old it was, is found by the mark on each command (`parts/sender.py`) in the
senders' own logs. Motion that is in nobody's log was asked by nobody.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from lira.hal.messages import Reason
from lira.tools.stop_test.journal import Heard, Journal, Said, Sent, Truth, Wheels

Result = dict[str, str | float | int | bool]
ASKED = 3  # commands of motion that have to reach a robot that shall not move
REACH_S = 0.15  # between the governor's word and the wheels, at most

# What may stop a robot, by the governor's reason.
WATCHDOG, REFUSAL, ESTOP, FIELD = "watchdog", "refusal", "e-stop", "protective field"
DRIVER, FAREWELL, HELD = "zero commanded", "commander left", "neutral first"
# The governor knows nothing of these.
GUARD, BASE, BOARD = "base's guard process", "base driver's watchdog", "base board"
CONTROLLER = "robot's own controller"
STOPPERS: dict[Reason, str] = {
    Reason.STALE: WATCHDOG,
    Reason.REFUSED: REFUSAL,
    Reason.ESTOP: ESTOP,
    Reason.OBSTACLE: FIELD,
    Reason.OK: DRIVER,
    Reason.NO_COMMAND: FAREWELL,
    Reason.NEUTRAL_FIRST: HELD,
}


@dataclass(frozen=True, slots=True)
class Rules:
    """What may happen in a trial. Times are those of the journal; what was before `began_s` does not matter.

    `drives` may move the wheels, until `broken_s` and by commands no older than `stale_s`; nobody else ever. Until
    `silent_s` the fault is to change nothing: they may stand and drive on by a neutral command of their own, as they do
    where the machine lets them wait for their sensors. After the first zero from then on nobody may, until `mended_s`
    and for ever if not `resumes`; then only after a neutral command of `drives`, which has to come after `mended_s` if
    it `renews`. From `shut_out_s` on what they send counts for nothing. `asks` are those whose wish to move,
    from `asked_from_s` on, makes the trial one. `below`: who stopped it where the governor did not.
    """

    began_s: float
    broken_s: float
    mended_s: float
    end_s: float
    silent_s: float = -math.inf
    drives: frozenset[str] = frozenset({"driver"})
    stale_s: float = 0.27
    resumes: bool = False
    renews: bool = False
    shut_out_s: float = math.inf
    asked_from_s: float = -math.inf
    asks: frozenset[str] = frozenset({"driver", "hand", "fusion"})
    below: str = GUARD


@dataclass(frozen=True, slots=True)
class Verdict:
    """One trial. `zero_s` counts from the last command that was obeyed until the wheels got zero, inf if never.

    `fault_to_zero_s` counts from the fault: a sensor that freezes, say, is old before anybody can know. `asked` is how
    often motion was asked of the robot once it was mended, `refused` how many commands were refused as they should,
    `stall_s` for how long at once the machine had no time for anybody, `waited_s` for how long in all the process of
    which it had least waited for a processor.
    """

    zero_s: float
    fault_to_zero_s: float
    distance_m: float
    stale_obeyed: int
    moved_unasked: bool
    stopped_by: str
    asked: int = 0
    refused: int = 0
    stall_s: float = 0.0
    waited_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Bounds:
    """What a row allows. `within_s` is from the fault; `refusal` says whether refusals have to be counted."""

    budget_s: float
    stoppers: frozenset[str]
    within_s: float = math.inf
    refusal: bool = False
    asked: int = ASKED


@dataclass(frozen=True, slots=True)
class Logs:
    """Finds the command behind a motion of the wheels."""

    by_mark: dict[float, Sent] = field(default_factory=dict)

    def origin(self, given: Wheels | Heard) -> Sent | None:
        """The command that this motion came from; None if nobody sent it."""
        if not math.isfinite(given.linear_m_s):
            return None
        sent = self.by_mark.get(given.angular_rad_s)
        return sent if sent is not None and sent.time_s <= given.time_s else None


def judge(journal: Journal, rules: Rules) -> Verdict:
    """Judge what was noted."""
    logs = Logs({one.angular_rad_s: one for one in journal.sent if one.moving})
    moving = [one for one in journal.wheels if one.moving and one.time_s >= rules.began_s]
    from_s = max(rules.broken_s, rules.silent_s)
    zeros = (one.time_s for one in journal.wheels if not one.moving and one.time_s >= from_s)
    zero_at_s = next(zeros, math.inf) if _drove(journal.wheels, from_s) else math.inf
    origins = [logs.origin(one) for one in moving]
    pairs = list(zip(moving, origins, strict=True))
    obeyed = [sent.time_s for one, sent in pairs if sent is not None and one.time_s <= zero_at_s]
    last_s = max(obeyed, default=-math.inf)
    return Verdict(
        zero_s=max(zero_at_s - last_s, 0.0),
        fault_to_zero_s=max(zero_at_s - rules.broken_s, 0.0),
        distance_m=_path_m([one for one in journal.truth if last_s <= one.time_s <= rules.end_s]),
        stale_obeyed=sum(one.time_s - sent.time_s > rules.stale_s for one, sent in pairs if sent is not None),
        moved_unasked=any(not _asked_for(one, sent, zero_at_s, journal.sent, rules) for one, sent in pairs)
        or _drove_on(journal, logs, rules),
        stopped_by=_stopper(journal.said, zero_at_s) or rules.below,
        asked=_asked(journal, logs, max(zero_at_s, rules.mended_s, rules.asked_from_s), rules),
        stall_s=max((one.stall_s for one in journal.stalled if one.time_s >= rules.began_s), default=0.0),
    )


def _drove(wheels: Sequence[Wheels], from_s: float) -> bool:
    """Whether there was anything to stop by then."""
    before = [one for one in wheels if one.time_s < from_s]
    return bool(before) and before[-1].moving


def _drove_on(journal: Journal, logs: Logs, rules: Rules) -> bool:
    """Whether the wheels stood before the silence, and moved again though nobody who may had said neutral."""
    obeyed_s, stood = -math.inf, False
    for one in journal.wheels:
        if rules.broken_s <= one.time_s < rules.silent_s:
            if one.moving and stood and not _neutrals(journal.sent, obeyed_s, one.time_s, rules):
                return True
            stood = not one.moving
        if one.moving and (sent := logs.origin(one)) is not None:
            obeyed_s = sent.time_s
    return False


def _neutrals(sends: Sequence[Sent], since_s: float, until_s: float, rules: Rules) -> bool:
    """Whether somebody who may move the wheels has said neutral meanwhile."""
    return any(n.who in rules.drives and not n.moving and since_s <= n.time_s <= until_s for n in sends)


def _asked_for(one: Wheels, sent: Sent | None, zero_at_s: float, sends: Sequence[Sent], rules: Rules) -> bool:
    """Whether somebody who may has asked for this motion, and for motion at all since it stopped."""
    if sent is None or sent.who not in rules.drives or sent.time_s > rules.shut_out_s:
        return False
    if one.time_s <= zero_at_s:
        return True
    if not rules.resumes or one.time_s < rules.mended_s:
        return False
    return _neutrals(sends, rules.mended_s if rules.renews else rules.broken_s, one.time_s, rules)


def _asked(journal: Journal, logs: Logs, since_s: float, rules: Rules) -> int:
    """How often motion was asked for: by what reached the robot, or, of those who are shut out, by what they sent."""
    if math.isfinite(rules.shut_out_s):
        return sum(one.moving and one.who in rules.asks and one.time_s > since_s for one in journal.sent)
    origins = (logs.origin(one) for one in journal.heard if one.time_s > since_s)
    return sum(sent is not None and sent.who in rules.asks for sent in origins)


def _stopper(said: Sequence[Said], zero_at_s: float) -> str:
    """Why the governor let no more motion through just before the wheels had zero; "" if it did."""
    if math.isinf(zero_at_s):
        return "nothing"
    turns = (b for a, b in pairwise(said) if a.moving and not b.moving and abs(b.time_s - zero_at_s) <= REACH_S)
    turn = next(turns, None)
    return "" if turn is None else STOPPERS[turn.reason]


def _path_m(points: Sequence[Truth]) -> float:
    """Length of the way from the first point on."""
    xy = np.array([(one.x_m, one.y_m) for one in points]).reshape(-1, 2)
    return float(np.hypot(*np.diff(xy, axis=0).T).sum()) if len(xy) > 1 else 0.0


def within(bounds: Bounds, verdict: Verdict) -> bool:
    """Whether one trial went as it should."""
    return (
        verdict.zero_s <= bounds.budget_s
        and verdict.fault_to_zero_s <= bounds.within_s
        and verdict.stale_obeyed == 0
        and not verdict.moved_unasked
        and verdict.asked >= bounds.asked
        and (verdict.refused > 0 or not bounds.refusal)
        and verdict.stopped_by in bounds.stoppers
    )


def summarize(name: str, bounds: Bounds, verdicts: Sequence[Verdict]) -> Result:
    """Sum the trials of one row up: the worst decides."""
    zeros_s = [one.zero_s for one in verdicts]
    worst_s = max(zeros_s)
    return {
        "fault": name,
        "n": len(verdicts),
        "p50_s": float(np.percentile(zeros_s, 50)) if math.isfinite(worst_s) else math.inf,
        "p99_s": float(np.percentile(zeros_s, 99)) if math.isfinite(worst_s) else math.inf,
        "max_time_to_zero_s": worst_s,
        "fault_to_zero_s": max(one.fault_to_zero_s for one in verdicts),
        "distance_m": max(one.distance_m for one in verdicts),
        "stale_obeyed": sum(one.stale_obeyed for one in verdicts),
        "moved_unasked": any(one.moved_unasked for one in verdicts),
        "asked": min(one.asked for one in verdicts),
        "refused": min(one.refused for one in verdicts),
        "stopped_by": ", ".join(sorted({one.stopped_by for one in verdicts})),
        "budget_s": bounds.budget_s,
        "passed": all(within(bounds, one) for one in verdicts),
    }
