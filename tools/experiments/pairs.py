"""Trials of one seed are pairs: ratios of what two methods, or two teachers, took, with 95 % intervals."""

from collections.abc import Iterable, Mapping, Sequence

from lira.tools.experiments.experiment import Row
from lira.tools.experiments.statistics import median_interval, paired_ratios
from lira.tools.experiments.trial import Outcome

TOTAL = "human_labels and demonstration"


def taken(outcome: Outcome, quantity: str) -> float:
    """A quantity of the result by its name; `TOTAL` is every label that the human gave."""
    result = outcome.result
    return float(result.human_labels + result.demonstration if quantity == TOTAL else getattr(result, quantity))


def ratio(numerator: Sequence[Outcome], denominator: Sequence[Outcome], quantity: str) -> Row:
    """One quantity of the results over another's: columns `median`, `low`, `high`, `n`, `censored`.

    Both are in the order of the same seeds. `censored` counts pairs in which either run met its cap: where that is the
    numerator's, the true ratio is larger.
    """
    values = paired_ratios(*([taken(each, quantity) for each in group] for group in (numerator, denominator)))
    median, low, high = median_interval(values)
    pairs = zip(numerator, denominator, strict=True)
    censored = sum(not (a.result.converged and b.result.converged) for a, b in pairs)
    return {"median": median, "low": low, "high": high, "n": len(values), "censored": censored}


def ratios(
    groups: Mapping[str, Sequence[Outcome]], names: Iterable[tuple[str, str]], quantities: Sequence[str]
) -> list[Row]:
    """Second over first for each pair of methods that were played, one row per quantity: `Experiment.ratios`."""
    return [
        {"method": method, "against": against, "quantity": quantity} | ratio(groups[against], groups[method], quantity)
        for method, against in names
        if method in groups and against in groups
        for quantity in quantities
    ]


def bounds(row: Row) -> tuple[float, float]:
    """Ends of a ratio's interval."""
    return float(str(row["low"])), float(str(row["high"]))


def words(row: Row) -> str:
    """A ratio in words."""
    low, high = bounds(row)
    return f"{row['median']:.2f} [{low:.2f}, {high:.2f}], n {row['n']}, {row['censored']} censored"
