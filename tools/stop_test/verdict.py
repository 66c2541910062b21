"""What a trial's journal says: how soon it stood, how far it went, what it obeyed, and whether it moved again. Pure."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from hal.messages import Reason
from hal.profile import RobotProfile
from tools.stop_test.journal import Given, Truth

Row = dict[str, str | float | int | bool]
STILL_M_S = 1e-6
TICK_S = 0.02  # the watchdog may look this much after the time-out
NOTED_S = 0.03  # the governor notes what it gave this much after the wheels had it, at most

# What may stop a robot, by the governor's reason.
WATCHDOG, REFUSAL, ESTOP, FIELD = "watchdog", "refusal", "e-stop", "protective field"
DRIVER, FAREWELL = "zero commanded", "commander left"
GUARD, BASE = "base's guard process", "base driver's watchdog"  # the governor knows nothing of these
STOPPERS: dict[Reason, str] = {
    Reason.STALE: WATCHDOG,
    Reason.REFUSED: REFUSAL,
    Reason.ESTOP: ESTOP,
    Reason.OBSTACLE: FIELD,
    Reason.OK: DRIVER,
    Reason.NO_COMMAND: FAREWELL,
    Reason.NEUTRAL_FIRST: "stopped before",
}


@dataclass(frozen=True, slots=True)
class Verdict:
    """One trial. `zero_s` counts from the last command that was obeyed until the wheels got zero, inf if never.

    `fault_to_zero_s` counts from the fault: a sensor that freezes, say, is old before anybody can know.
    """

    zero_s: float
    fault_to_zero_s: float
    distance_m: float
    stale_obeyed: int
    moved_unasked: bool
    stopped_by: str
    refused: int = 0  # commands


def judge(
    given: Sequence[Given],
    truth: Sequence[Truth],
    broken_s: float,
    end_s: float,
    profile: RobotProfile,
    below: str = GUARD,
) -> Verdict:
    """Judge what was noted from the fault on. The wheels have zero when told so, or when the body stands by itself.

    `below` is who did it if the governor knows nothing of it.
    """
    after = [one for one in given if one.time_s >= broken_s]
    moving = [one for one in after if one.moving] or [one for one in given if one.moving][-1:]
    if not moving:
        return Verdict(math.inf, math.inf, 0.0, 0, moved_unasked=False, stopped_by="nothing")
    first_zero_s = next((one.time_s for one in after if not one.moving), math.inf)
    stood_s = next((one.time_s for one in truth if one.time_s >= broken_s and _still(one)), math.inf)
    zero_at_s = min(first_zero_s, stood_s)
    obeyed = [one for one in given if one.moving and one.time_s <= zero_at_s]
    last_command_s = max((one.time_s - one.age_s for one in obeyed), default=broken_s)
    again = [one for one in after if one.moving and one.time_s > zero_at_s]
    limit_s = profile.control.policy_timeout_s + TICK_S
    distance_m = _path_m([one for one in truth if last_command_s <= one.time_s <= end_s])
    return Verdict(
        zero_s=max(zero_at_s - last_command_s, 0.0),
        fault_to_zero_s=max(zero_at_s - broken_s, 0.0),
        distance_m=distance_m,
        stale_obeyed=sum(one.age_s > limit_s for one in after if one.moving),
        moved_unasked=bool(again),
        stopped_by=_stopper(after, zero_at_s) or below,
    )


def _stopper(given: Sequence[Given], zero_at_s: float) -> str:
    """What made the governor give the first zero; "" if it was not the governor."""
    if math.isinf(zero_at_s):
        return "nothing"
    noted = (one.reason for one in given if not one.moving and abs(one.time_s - zero_at_s) <= NOTED_S)
    return next((STOPPERS[reason] for reason in noted if reason is not None), "")


def _still(one: Truth) -> bool:
    return abs(one.speed_m_s) < STILL_M_S


def _path_m(points: Sequence[Truth]) -> float:
    """Length of the way from the first point until it stands."""
    xy = np.array([(one.x_m, one.y_m) for one in points]).reshape(-1, 2)
    return float(np.hypot(*np.diff(xy, axis=0).T).sum()) if len(xy) > 1 else 0.0


def summarize(
    fault: str, stoppers: Collection[str], verdicts: Sequence[Verdict], budget_s: float, *, counted: bool = False
) -> Row:
    """Sum the trials of one fault up. One of `stoppers` has to stop it. `counted`: each has to show up as refused."""
    zeros_s = [one.zero_s for one in verdicts]
    worst_s = max(zeros_s)
    told = all(one.refused > 0 for one in verdicts) or not counted
    stopped_by = sorted({one.stopped_by for one in verdicts})
    stale, moved = sum(one.stale_obeyed for one in verdicts), any(one.moved_unasked for one in verdicts)
    return {
        "fault": fault,
        "n": len(verdicts),
        "p50_s": float(np.percentile(zeros_s, 50)) if math.isfinite(worst_s) else math.inf,
        "p99_s": float(np.percentile(zeros_s, 99)) if math.isfinite(worst_s) else math.inf,
        "max_time_to_zero_s": worst_s,
        "fault_to_zero_s": max(one.fault_to_zero_s for one in verdicts),
        "distance_m": max(one.distance_m for one in verdicts),
        "stale_obeyed": stale,
        "moved_unasked": moved,
        "refused": sum(one.refused for one in verdicts),
        "stopped_by": ", ".join(stopped_by),
        "budget_s": budget_s,
        "passed": worst_s <= budget_s and stale == 0 and not moved and told and set(stopped_by) <= set(stoppers),
    }
