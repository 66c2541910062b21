"""Drawings that several experiments have in common."""

from collections.abc import Mapping, Sequence
from functools import partial

from lira.tools.experiments.experiment import Picture
from lira.tools.experiments.trial import Outcome


def box_pictures(groups: Mapping[str, Sequence[Outcome]], quantities: Sequence[str]) -> list[Picture]:
    """One box plot per quantity of the results, a box per group."""
    from lira.tools.experiments.output import plots

    cut = {name: [not each.result.converged for each in group] for name, group in groups.items()}
    return [
        Picture(
            quantity,
            f"{spelt(quantity).capitalize()} until the novice passed; a cross is a run that never did",
            partial(
                plots.boxes,
                {name: [getattr(each.result, quantity) for each in group] for name, group in groups.items()},
                cut,
                spelt(quantity),
            ),
        )
        for quantity in quantities
    ]


def spelt(quantity: str) -> str:
    """A quantity's name in words."""
    return quantity.replace("_", " ")
