"""Table D.1: LIRA-SPF with shared feedback on the figure-eight with boxes, at 0.5 m/s."""

from lira.fusion.methods.presets import METHODS
from lira.tools.experiments.effort import pairs
from lira.tools.experiments.effort.measures import by_method, driving_row, effort_row, label_row, method_rows
from lira.tools.experiments.effort.pairs import bounds, words
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Picture, Row, Table
from lira.tools.experiments.output.pictures import box_pictures, spelt
from lira.tools.experiments.trial import Trial

PRESETS = ("thesis", "hold")
QUANTITIES = ("buffer", "human_labels", "interventions")
# Table D.1 as printed.
THESIS = {
    "fixed": {"buffer": 296, "training_steps": 9, "human_labels": 50, "interventions": 25},
    "flexible": {"buffer": 236, "training_steps": 8, "human_labels": 92, "interventions": 16},
}


def trials(seeds: int) -> list[Trial]:
    """Both settings on both presets, and the presets without it, on every seed."""
    names = [name for preset in PRESETS for name in (preset, *(f"{preset}-{when}" for when in THESIS))]
    return [
        Trial(METHODS[name], "eight-obstacles", seed, max_linear_m_s=0.5) for name in names for seed in range(seeds)
    ]


def ratios(outcomes: Outcomes) -> list[Row]:
    """Fixed over flexible, pair by pair of one seed."""
    compared = [(f"{preset}-flexible", f"{preset}-fixed") for preset in PRESETS]
    return pairs.ratios(by_method(outcomes), compared, QUANTITIES)


def tables(outcomes: Outcomes) -> list[Table]:
    """The settings beside the thesis's."""
    ours: list[Row] = method_rows(outcomes, label_row)
    thesis: list[Row] = [{"method": f"thesis: {when}", "n": 10} | dict(row) for when, row in THESIS.items()]
    return [
        Table("Labels and interventions until the novice passed its proving run", [*ours, *thesis]),
        Table("Fixed over flexible, by pairs of one seed", ratios(outcomes)),
        Table("Calls and the human's time", method_rows(outcomes, effort_row)),
        Table("Driving", method_rows(outcomes, driving_row)),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Fixed takes more interventions and a larger buffer, but fewer human labels."""
    found = []
    for row in ratios(outcomes):
        quantity = str(row["quantity"])
        low, high = bounds(row)
        theirs = THESIS["fixed"][quantity] / THESIS["flexible"][quantity]
        found.append(
            Finding(
                f"tableD1.{row['method']}.{quantity}",
                f"{row['against']} over {row['method']}, {spelt(quantity)}: on the thesis's side of 1",
                f"{theirs:.2f}",
                words(row),
                low > 1.0 if theirs > 1.0 else high < 1.0,
            )
        )
    return found


def figures(outcomes: Outcomes) -> list[Picture]:
    """Human labels and interventions by setting."""
    return box_pictures(by_method(outcomes), QUANTITIES[1:])


EXPERIMENTS = {"tableD1": Experiment(trials=trials, tables=tables, findings=findings, figures=figures, ratios=ratios)}
