"""Trials of one seed are pairs: ratios of what two methods, or two teachers, took, with 95 % intervals."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

from lira.tools.experiments.effort.statistics import median_interval, paired_ratios
from lira.tools.experiments.experiment import Row
from lira.tools.experiments.trial import Outcome

TOTAL = "human_labels and demonstration"


class Spent(Protocol):
    """What teaching had taken by some time."""

    @property
    def human_labels(self) -> int:
        """Labels of the human, after the demonstration."""

    @property
    def demonstration(self) -> int:
        """Labels before anything was learned."""


class Effort(Spent, Protocol):
    """What it had taken until it had come to what was wanted."""

    @property
    def converged(self) -> bool:
        """False for a run that met its cap: it counts with what it had used."""


At = Callable[[Outcome], Effort]


def in_the_end(outcome: Outcome) -> Effort:
    """All that a trial took."""
    return outcome.result


def taken(effort: Spent, quantity: str) -> float:
    """A quantity by its name; `TOTAL` is every label that the human gave."""
    return float(effort.human_labels + effort.demonstration if quantity == TOTAL else getattr(effort, quantity))


def ratio(numerator: Sequence[Outcome], denominator: Sequence[Outcome], quantity: str, at: At = in_the_end) -> Row:
    """One quantity over another's: columns `median`, `low`, `high`, `n`, `censored`.

    Both are in the order of the same seeds. `censored` counts pairs in which either run met its cap: where that is the
    numerator's, the true ratio is larger.
    """
    efforts = [[at(outcome) for outcome in group] for group in (numerator, denominator)]
    values = paired_ratios(*([taken(each, quantity) for each in group] for group in efforts))
    median, low, high = median_interval(values)
    censored = sum(not (a.converged and b.converged) for a, b in zip(*efforts, strict=True))
    return {"median": median, "low": low, "high": high, "n": len(values), "censored": censored}


def ratios(
    groups: Mapping[str, Sequence[Outcome]],
    names: Iterable[tuple[str, str]],
    quantities: Sequence[str],
    at: At = in_the_end,
) -> list[Row]:
    """Second over first for each pair of methods that were played, one row per quantity: `Experiment.ratios`."""
    return [
        {"method": method, "against": against, "quantity": quantity}
        | ratio(groups[against], groups[method], quantity, at)
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
