"""What each part of `plus` is worth: left out one by one on line-obstacles, with experts no choice was made on."""

from lira.fusion.methods.presets import METHODS
from lira.tools.experiments import pairs
from lira.tools.experiments.experiment import Experiment, Outcomes, Picture, Row, Table
from lira.tools.experiments.measures import driving_row, effort_row, label_row, method_rows
from lira.tools.experiments.pictures import box_pictures
from lira.tools.experiments.trial import Outcome, Trial

WORLD = "line-obstacles"
PAIRS = ("line@1", "line@2", "line@3")
BASE = "plus"
NAMES = (BASE, *(name for name in METHODS if name.startswith("plus-no-")), "plus-network", "plus-own")
QUANTITIES = ("human_labels", "interventions")


def trials(seeds: int) -> list[Trial]:
    """The preset, and each of its parts left out, with every pair of experts on every seed."""
    return [
        Trial(METHODS[name], WORLD, seed, experts=pair) for name in NAMES for pair in PAIRS for seed in range(seeds)
    ]


def by_name(outcomes: Outcomes) -> dict[str, list[Outcome]]:
    """Outcomes of each method in one order of pairs and seeds."""
    ordered = sorted(outcomes, key=lambda each: (each.trial.pair, each.trial.seed))
    return {name: [each for each in ordered if each.trial.method.name == name] for name in NAMES}


def ratios(outcomes: Outcomes) -> list[Row]:
    """Without a part over with all of them, pair by pair of one seed and one pair of experts."""
    return pairs.ratios(by_name(outcomes), [(BASE, name) for name in NAMES[1:]], (*QUANTITIES, "calls"))


def tables(outcomes: Outcomes) -> list[Table]:
    """With and without each part, and the ratios."""
    return [
        Table("Labels and interventions", method_rows(outcomes, label_row)),
        Table("Without a part over with all of them", ratios(outcomes), "Above 1 the part saves something."),
        Table("Calls and the human's time", method_rows(outcomes, effort_row)),
        Table("Driving", method_rows(outcomes, driving_row)),
    ]


def figures(outcomes: Outcomes) -> list[Picture]:
    """Human labels and interventions by method."""
    return box_pictures(by_name(outcomes), QUANTITIES)


EXPERIMENTS = {
    "ablation": Experiment(
        trials=trials,
        tables=tables,
        findings=lambda _: [],  # the thesis has no such preset
        figures=figures,
        ratios=ratios,
    )
}
