"""LIRA-SPF against HG-DAgger on one world: Table II (`line-obstacles`) and figures 11 and 12 (`race`)."""

from collections.abc import Sequence
from functools import partial

from lira.fusion.experts.tasks import task_of
from lira.tools.experiments.effort import pairs
from lira.tools.experiments.effort.measures import (
    by_method,
    driving_row,
    effort_row,
    expert_labels,
    label_row,
    method_rows,
    source_rows,
)
from lira.tools.experiments.effort.pairs import TOTAL, bounds, words
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Picture, Row, Table
from lira.tools.experiments.methods import ALL, HG_DAGGER, LIRA, USUAL
from lira.tools.experiments.output.pictures import box_pictures, spelt
from lira.tools.experiments.trial import Preset, Trial

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
DEMONSTRATED = "Where the experts' own labels begin it (plus, and after a warm start) nobody demonstrates."
THESIS_RATIOS = {"human_labels": 156.5 / 59, "interventions": 19.5 / 9.5}


def trials(seeds: int, world: str, methods: Sequence[Preset] = ALL) -> list[Trial]:
    """Each of the methods on every seed."""
    return [Trial(method, world, seed) for method in methods for seed in range(seeds)]


def summary(outcomes: Outcomes) -> list[Row]:
    """One row per method in the columns of Table II."""
    return method_rows(outcomes, label_row)


def ratios(outcomes: Outcomes, quantities: Sequence[str] = QUANTITIES) -> list[Row]:
    """HG-DAgger over LIRA-SPF, pair by pair of one seed."""
    compared = [(method.name, against.name) for method in LIRA for against in HG_DAGGER]
    return pairs.ratios(by_method(outcomes), compared, quantities)


def amortised(outcomes: Outcomes) -> list[Row]:
    """After how many tasks the labels that trained the experts are paid back by what LIRA-SPF saves on each.

    A task costs the labels of the demonstration and of the interventions, medians over the seeds.
    """
    groups = by_method(outcomes)
    cost = {name: effort_row(group)["human_total"] for name, group in groups.items()}
    experts = sum(expert_labels(task_of(outcomes[0].trial.world)).values())
    rows: list[Row] = []
    for method in (each.name for each in LIRA if each.name in groups):
        for against in (each.name for each in HG_DAGGER if each.name in groups):
            saved = float(str(cost[against])) - float(str(cost[method]))
            rows.append(
                {
                    "method": method,
                    "against": against,
                    "experts_labels": experts,
                    "saved_per_task": saved,
                    "tasks_until_paid": experts / saved if saved > 0 else None,
                }
            )
    return rows


def tables(outcomes: Outcomes, thesis: Sequence[Row]) -> list[Table]:
    """The methods beside the thesis's, the paired ratios, and what else it took."""
    theirs = ", ".join(f"{value:.2f} {spelt(quantity)}" for quantity, value in THESIS_RATIOS.items())
    found = [
        Table("Labels and interventions until the novice passed its proving run", [*summary(outcomes), *thesis]),
        Table("HG-DAgger over LIRA-SPF, by pairs of one seed", ratios(outcomes), f"Thesis, Table II: {theirs}."),
        Table("The same with the initial demonstration counted", ratios(outcomes, [TOTAL]), DEMONSTRATED),
        Table("Calls and the human's time", method_rows(outcomes, effort_row)),
        Table("Labels by source", source_rows(outcomes), "Given, and stored in the buffer; the rest was redundant."),
        Table("Driving", method_rows(outcomes, driving_row)),
        Table("Labels that trained the experts, paid back", amortised(outcomes), "Labels are medians over the seeds."),
    ]
    return [table for table in found if table.rows]


def findings(outcomes: Outcomes, name: str) -> list[Finding]:
    """Whether LIRA-SPF needs less of the human than HG-DAgger at the same m, and by as much as the thesis says."""
    found: list[Finding] = []
    for row in ratios(outcomes):
        if row["against"] != HG_DAGGER[0].name:
            continue
        method, quantity = row["method"], str(row["quantity"])
        (low, high), theirs = bounds(row), THESIS_RATIOS[quantity]
        key, claim = f"{name}.{method}.{quantity}", f"HG-DAgger over {method}, {spelt(quantity)}"
        found += [
            Finding(f"{key}.fewer", f"{claim}: above 1", f"{theirs:.2f}", words(row), low > 1.0),
            Finding(f"{key}.size", f"{claim}: as in Table II", f"{theirs:.2f}", words(row), low <= theirs <= high),
        ]
    return found


def figures(outcomes: Outcomes) -> list[Picture]:
    """Figures 11 and 12, and the ratios."""
    from lira.tools.experiments.output import plots

    pictures, rows = box_pictures(by_method(outcomes), QUANTITIES), ratios(outcomes)
    caption = "HG-DAgger over LIRA-SPF, pair by pair: medians and 95 % intervals"
    drawn = Picture("ratios", caption, partial(plots.intervals, rows, THESIS_RATIOS))
    return [*pictures, drawn] if rows else pictures


EXPERIMENTS = {
    name: Experiment(
        trials=partial(trials, world=world),
        tables=partial(tables, thesis=thesis),
        findings=partial(findings, name=name),
        figures=figures,
        ratios=ratios,
        methods=tuple(method.name for method in ALL),
        usual=tuple(method.name for method in USUAL),
    )
    for name, world, thesis in (("table2", "line-obstacles", THESIS), ("race", "race", []))
}
