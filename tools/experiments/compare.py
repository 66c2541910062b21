"""LIRA-SPF against HG-DAgger on one world: Table II (`line-obstacles`) and figures 11 and 12 (`race`)."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from tools.experiments.experiment import Experiment, Finding, Outcomes, Row, Table
from tools.experiments.methods import HG_DAGGER, LIRA
from tools.experiments.statistics import iqm, median_interval, paired_ratios
from tools.experiments.trial import Outcome, Trial

QUANTITIES = ("human_labels", "interventions")
# Table II as printed, in the columns of our summary.
THESIS: list[Row] = [
    {
        "method": "thesis: LIRA-SPF",
        "n": 10,
        "buffer_first": 158,
        "human_labels_first": 50,
        "interventions_first": 7,
        "buffer": 273.5,
        "human_labels": 59,
        "interventions": 9.5,
    },
    {
        "method": "thesis: HG-DAgger",
        "n": 10,
        "buffer_first": 167,
        "human_labels_first": 96.5,
        "interventions_first": 11,
        "buffer": 228,
        "human_labels": 156.5,
        "interventions": 19.5,
    },
]
THESIS_RATIOS = {"human_labels": 156.5 / 59, "interventions": 19.5 / 9.5}


def trials(seeds: int, world: str) -> list[Trial]:
    """Every method on every seed."""
    return [Trial(method, world, seed) for method in (*LIRA, *HG_DAGGER) for seed in range(seeds)]


def by_method(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """Outcomes of each method, in the order of the seeds."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in sorted(outcomes, key=lambda each: each.trial.seed):
        groups.setdefault(outcome.trial.method.name, []).append(outcome)
    return groups


def summary(outcomes: Sequence[Outcome]) -> list[Row]:
    """One row per method: medians and interquartile means over the seeds, after the first lap and at the end."""
    rows: list[Row] = []
    for method, group in by_method(outcomes).items():
        first = [outcome.after(1) for outcome in group]
        final = [outcome.result for outcome in group]
        unseen = [lap for outcome in group for lap in outcome.laps if lap.phase == "unseen"]
        rows.append(
            {
                "method": method,
                "n": len(group),
                "censored": sum(not result.converged for result in final),
                "laps": _median([result.laps for result in final]),
                "buffer_first": _median([lap.buffer for lap in first]),
                "human_labels_first": _median([lap.human_labels for lap in first]),
                "interventions_first": _median([lap.interventions for lap in first]),
                "buffer": _median([result.buffer for result in final]),
                "human_labels": _median([result.human_labels for result in final]),
                "human_labels_iqm": iqm([result.human_labels for result in final]),
                "interventions": _median([result.interventions for result in final]),
                "interventions_iqm": iqm([result.interventions for result in final]),
                "demonstration": _median([result.demonstration for result in final]),
                "calls": _median([result.calls for result in final]),
                "unassisted_laps": sum(any(lap.unassisted for lap in o.laps if lap.phase == "train") for o in group),
                "unseen_passed": sum(lap.passed for lap in unseen),
                "unseen_laps": len(unseen),
                "unseen_collisions": sum(lap.collisions for lap in unseen),
                "lateral_rms_m": _median([lap.lateral_rms_m or 0.0 for lap in unseen]) if unseen else None,
            }
        )
    return rows


def ratios(outcomes: Sequence[Outcome]) -> list[Row]:
    """HG-DAgger over LIRA-SPF, pair by pair of one seed, with 95 % bootstrap intervals of the median.

    `censored` counts pairs in which either run met its cap. Where that is HG-DAgger's, its true ratio is larger.
    """
    groups = by_method(outcomes)
    rows: list[Row] = []
    for method in (each.name for each in LIRA if each.name in groups):
        for against in (each.name for each in HG_DAGGER if each.name in groups):
            pairs = list(zip(groups[method], groups[against], strict=True))
            for quantity in QUANTITIES:
                values = paired_ratios(
                    [getattr(theirs.result, quantity) for _, theirs in pairs],
                    [getattr(ours.result, quantity) for ours, _ in pairs],
                )
                median, low, high = median_interval(values)
                censored = sum(not (a.result.converged and b.result.converged) for a, b in pairs)
                rows.append(
                    {
                        "method": method,
                        "against": against,
                        "quantity": quantity,
                        "median": median,
                        "low": low,
                        "high": high,
                        "n": len(pairs),
                        "censored": censored,
                    }
                )
    return rows


def _median(values: Sequence[float]) -> float:
    return float(np.median(np.asarray(values, dtype=np.float64)))


def tables(outcomes: Outcomes, thesis: Sequence[Row]) -> list[Table]:
    """The methods beside the thesis's, and the paired ratios."""
    words = ", ".join(f"{value:.2f} {quantity}" for quantity, value in THESIS_RATIOS.items())
    return [
        Table("Labels and interventions until the novice passed its proving run", [*summary(outcomes), *thesis]),
        Table("HG-DAgger over LIRA-SPF, by pairs of one seed", ratios(outcomes), f"Thesis, Table II: {words}."),
    ]


def findings(outcomes: Outcomes, name: str) -> list[Finding]:
    """Whether LIRA-SPF needs less of the human than HG-DAgger at the same m, and by as much as the thesis says."""
    found: list[Finding] = []
    for row in ratios(outcomes):
        if row["against"] != HG_DAGGER[0].name:
            continue
        method, quantity = str(row["method"]), str(row["quantity"])
        median, low, high = (float(str(row[each])) for each in ("median", "low", "high"))
        ours = f"{median:.2f} [{low:.2f}, {high:.2f}], n {row['n']}, {row['censored']} censored"
        theirs, words = THESIS_RATIOS[quantity], quantity.replace("_", " ")
        key = f"{name}.{method}.{quantity}"
        claim = f"HG-DAgger over {method}, {words}"
        found.append(Finding(f"{key}.fewer", f"{claim}: above 1", f"{theirs:.2f}", ours, low > 1.0))
        found.append(Finding(f"{key}.size", f"{claim}: as in Table II", f"{theirs:.2f}", ours, low <= theirs <= high))
    return found


EXPERIMENTS = {
    name: Experiment(
        trials=partial(trials, world=world),
        tables=partial(tables, thesis=thesis),
        findings=partial(findings, name=name),
        ratios=ratios,
    )
    for name, world, thesis in (("table2", "line-obstacles", THESIS), ("race", "race", []))
}
