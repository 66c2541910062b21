"""LIRA-SPF against HG-DAgger on one world: Table II (`line-obstacles`) and figures 11 and 12 (`race`)."""

from collections.abc import Sequence
from functools import partial

from tools.experiments.experiment import Experiment, Finding, Outcomes, Picture, Row, Table
from tools.experiments.measures import by_method, driving_row, effort_row, expert_labels, label_row
from tools.experiments.methods import HG_DAGGER, LIRA
from tools.experiments.statistics import median_interval, paired_ratios
from tools.experiments.trial import Trial

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


def summary(outcomes: Outcomes) -> list[Row]:
    """One row per method in the columns of Table II."""
    return [{"method": method} | label_row(group) for method, group in by_method(outcomes).items()]


def ratios(outcomes: Outcomes) -> list[Row]:
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


def amortised(outcomes: Outcomes) -> list[Row]:
    """After how many tasks the labels that trained the experts are paid back by what LIRA-SPF saves on each.

    A task costs the labels of the demonstration and of the interventions, medians over the seeds.
    """
    groups = by_method(outcomes)
    cost = {name: effort_row(group)["human_total"] for name, group in groups.items()}
    experts = sum(expert_labels().values())
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
    words = ", ".join(f"{value:.2f} {quantity}" for quantity, value in THESIS_RATIOS.items())
    groups = by_method(outcomes)
    return [
        Table("Labels and interventions until the novice passed its proving run", [*summary(outcomes), *thesis]),
        Table("HG-DAgger over LIRA-SPF, by pairs of one seed", ratios(outcomes), f"Thesis, Table II: {words}."),
        Table("Calls and the human's time", [{"method": name} | effort_row(group) for name, group in groups.items()]),
        Table("Driving", [{"method": name} | driving_row(group) for name, group in groups.items()]),
        Table("Labels that trained the experts, paid back", amortised(outcomes), "Labels are medians over the seeds."),
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


def figures(outcomes: Outcomes) -> list[Picture]:
    """Figures 11 and 12, and the ratios."""
    from tools.experiments import plots

    groups = by_method(outcomes)
    cut = {name: [not each.result.converged for each in group] for name, group in groups.items()}
    pictures = [
        Picture(
            quantity,
            f"{quantity.replace('_', ' ').capitalize()} until the novice passed; a cross is a run that never did",
            partial(
                plots.boxes,
                {name: [getattr(each.result, quantity) for each in group] for name, group in groups.items()},
                cut,
                quantity.replace("_", " "),
            ),
        )
        for quantity in QUANTITIES
    ]
    words = "HG-DAgger over LIRA-SPF, pair by pair: medians and 95 % intervals"
    return [*pictures, Picture("ratios", words, partial(plots.intervals, ratios(outcomes), THESIS_RATIOS))]


EXPERIMENTS = {
    name: Experiment(
        trials=partial(trials, world=world),
        tables=partial(tables, thesis=thesis),
        findings=partial(findings, name=name),
        figures=figures,
        ratios=ratios,
    )
    for name, world, thesis in (("table2", "line-obstacles", THESIS), ("race", "race", []))
}
