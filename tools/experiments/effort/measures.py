"""What is said about a group of trials (one method, or one teacher, over the seeds): rows of tables."""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from lira.fusion.experts.tasks import TASKS, task_of
from lira.fusion.log.run_log import LapRecord
from lira.hal.messages import Driver, Phase
from lira.hal.profile import load_profile
from lira.tools.experiments.effort.statistics import iqm
from lira.tools.experiments.experiment import Outcomes, Row
from lira.tools.experiments.trial import Outcome


def grouped(outcomes: Outcomes, key: Callable[[Outcome], str]) -> dict[str, list[Outcome]]:
    """Sort outcomes into groups, each in the order of the seeds; groups in the order of their first trial."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(key(outcome), []).append(outcome)
    return {name: sorted(group, key=lambda each: each.trial.seed) for name, group in groups.items()}


def by_method(outcomes: Outcomes) -> dict[str, list[Outcome]]:
    """Outcomes of each method."""
    return grouped(outcomes, lambda outcome: outcome.trial.method.name)


def method_rows(outcomes: Outcomes, row: Callable[[Sequence[Outcome]], Row]) -> list[Row]:
    """One row per method."""
    return [{"method": method} | row(group) for method, group in by_method(outcomes).items()]


def label_row(group: Sequence[Outcome]) -> Row:
    """The columns of Table II, medians over the seeds, with means and interquartile means of what is compared."""
    first = [outcome.after(1) for outcome in group]
    final = [outcome.result for outcome in group]
    row: Row = {
        "n": len(group),
        "censored": sum(not result.converged for result in final),
        "laps": median([result.laps for result in final]),
        "buffer_first": median([lap.buffer for lap in first]),
        "human_labels_first": median([lap.human_labels for lap in first]),
        "interventions_first": median([lap.interventions for lap in first]),
        "buffer": median([result.buffer for result in final]),
        "training_steps": median([result.training_steps for result in final]),
    }
    for quantity in ("human_labels", "interventions"):
        values = [getattr(result, quantity) for result in final]
        row |= {quantity: median(values), f"{quantity}_mean": float(np.mean(values)), f"{quantity}_iqm": iqm(values)}
    return row


def effort_row(group: Sequence[Outcome]) -> Row:
    """What it took of the human beside labels: time, calls and how good they were; medians over the seeds.

    Precision and recall are over all calls and interventions of the group together, and None for a method that never
    calls; the terms are those of `fusion.ledger.Account`. `with_experts` adds the labels that trained the experts,
    which every novice here begins with.
    """
    accounts = [outcome.result.account for outcome in group]
    task = task_of(group[0].trial.world)
    period_s = load_profile(TASKS[task].profile).period_s
    shown = [outcome.result.demonstration for outcome in group]
    episodes = sum(each.call_episodes for each in accounts)
    wanted = sum(outcome.result.interventions for outcome in group) if episodes else 0
    totals = [outcome.result.human_labels + labels for outcome, labels in zip(group, shown, strict=True)]
    return {
        "demonstration": median(shown),
        "human_time_s": median([each.human_steps * period_s for each in accounts]),
        "human_given": median([each.given.get(Driver.HUMAN, 0) for each in accounts]),
        "expert_stored": median([experts_share(each.stored) for each in accounts]),
        "calls": median([outcome.result.calls for outcome in group]),
        "call_episodes": median([each.call_episodes for each in accounts]),
        "precision": ratio(sum(each.answered for each in accounts), episodes),
        "recall": ratio(sum(each.called_for for each in accounts), wanted),
        "slowed_steps": median([each.slowed_steps for each in accounts]),
        "switches": median([each.switches for each in accounts]),
        "human_total": median(totals),
        "with_experts": median(totals) + sum(expert_labels(task).values()),
    }


def source_rows(outcomes: Outcomes) -> list[Row]:
    """Labels given and stored by each source of each method; medians over the seeds."""
    rows: list[Row] = []
    for method, group in by_method(outcomes).items():
        accounts = [outcome.result.account for outcome in group]
        for source in dict.fromkeys(source for each in accounts for source in each.given):
            given = median([each.given.get(source, 0) for each in accounts])
            stored = median([each.stored.get(source, 0) for each in accounts])
            rows.append({"method": method, "source": source, "given": given, "stored": stored})
    return rows


def driving_row(group: Sequence[Outcome]) -> Row:
    """How it was driven: collisions while it was taught, and how the novice drives layouts it has not seen."""
    taught = [lap for outcome in group for lap in outcome.laps if lap.phase == Phase.TRAIN]
    unseen = [lap for outcome in group for lap in outcome.laps if lap.phase == Phase.UNSEEN]
    return {
        "training_collisions": sum(lap.collisions for lap in taught),
        "training_lost": sum(lap.lost for lap in taught),
        "laps_without_human": sum(any(lap.unassisted for lap in o.laps if lap.phase == Phase.TRAIN) for o in group),
        "unseen_laps": len(unseen),
        "unseen_passed": sum(lap.passed for lap in unseen),
        "unseen_collisions": sum(lap.collisions for lap in unseen),
        "unseen_lost": sum(lap.lost for lap in unseen),
        "lateral_rms_m": known([lap.lateral_rms_m for lap in unseen]),
        "time_to_finish_s": known([time_to_finish_s(lap) for lap in unseen]),
    }


def time_to_finish_s(lap: LapRecord) -> float | None:
    """How long a lap took; None if it was not driven to the end unharmed."""
    return lap.duration_s if lap.passed else None


def experts_share(counts: dict[str, int]) -> int:
    """Labels that no human gave."""
    return sum(counts.values()) - counts.get(Driver.HUMAN, 0) - counts.get("demonstration", 0)


@cache
def expert_labels(task: str) -> dict[str, int]:
    """Labels that trained each expert of a task, from its file; an expert of an older version counts nothing."""
    from lira.fusion.experts.files import experts_of
    from lira.fusion.experts.load import load_network

    profile = load_profile(TASKS[task].profile)
    return {name: load_network(f"{name}-expert", profile, task)[1].labels or 0 for name in experts_of(profile)}


def median(values: Sequence[float]) -> float:
    """Median."""
    return float(np.median(np.asarray(values, dtype=np.float64)))


def known(values: Sequence[float | None]) -> float | None:
    """Median of what is known; None of nothing."""
    there = [value for value in values if value is not None]
    return median(there) if there else None


def ratio(part: float, whole: float) -> float | None:
    """A share; None of nothing."""
    return part / whole if whole else None
