"""What each choice within a method is worth: one thing differs from the base, on line-obstacles."""

from lira.fusion.methods.presets import METHODS
from lira.tools.experiments import pairs
from lira.tools.experiments.experiment import Experiment, Outcomes, Picture, Row, Table
from lira.tools.experiments.measures import by_method, driving_row, effort_row, label_row, method_rows
from lira.tools.experiments.pictures import box_pictures
from lira.tools.experiments.trial import Trial

WORLD = "line-obstacles"
QUANTITIES = ("human_labels", "interventions")
# Base -> what differs from it in one thing.
VARIANTS = {
    "hold": ("hold-mirrored",),
    "plus": ("plus-ask", "plus-sure"),
    "hg-dagger": ("hg-dagger-trunks", "hg-dagger-mirrored", "hg-dagger-doubt"),
}


def trials(seeds: int) -> list[Trial]:
    """Every base and every variant on every seed."""
    names = [name for base, variants in VARIANTS.items() for name in (base, *variants)]
    return [Trial(METHODS[name], WORLD, seed) for name in names for seed in range(seeds)]


def ratios(outcomes: Outcomes) -> list[Row]:
    """Each variant over its base, pair by pair of one seed."""
    compared = [(base, variant) for base, variants in VARIANTS.items() for variant in variants]
    return pairs.ratios(by_method(outcomes), compared, QUANTITIES)


def tables(outcomes: Outcomes) -> list[Table]:
    """Bases and variants, and the ratios."""
    return [
        Table("Labels and interventions", method_rows(outcomes, label_row)),
        Table("Variant over base, by pairs of one seed", ratios(outcomes), "Above 1 the variant takes more."),
        Table("Calls and the human's time", method_rows(outcomes, effort_row)),
        Table("Driving", method_rows(outcomes, driving_row)),
    ]


def figures(outcomes: Outcomes) -> list[Picture]:
    """Human labels and interventions by method."""
    return box_pictures(by_method(outcomes), QUANTITIES)


EXPERIMENTS = {
    "variants": Experiment(
        trials=trials,
        tables=tables,
        findings=lambda _: [],  # the thesis has no numbers for these
        figures=figures,
        ratios=ratios,
    )
}
