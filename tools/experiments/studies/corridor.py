"""Table III: one training lap through the corridor, on the twin of the real robot; then the novice drives alone."""

from collections.abc import Sequence

import numpy as np

from lira.fusion.methods.presets import METHODS
from lira.hal.messages import Phase
from lira.tools.experiments.effort.measures import by_method, effort_row, method_rows
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Picture, Row, Table
from lira.tools.experiments.output.pictures import box_pictures
from lira.tools.experiments.trial import Outcome, Trial

WORLD = "corridor"
NAMES = ("thesis", "hold", "hg-dagger")
# Table III as printed, but for HG-DAgger's human labels: 9.7 is a misprint, all of its buffer is the human's.
THESIS: dict[str, Row] = {
    "LIRA-SPF": {"buffer": 161.7, "human_labels": 52.7, "interventions": 6, "collisions_afterwards": 1},
    "HG-DAgger": {"buffer": 93.7, "human_labels": 93.7, "interventions": 13.3, "collisions_afterwards": 1},
}


def trials(seeds: int) -> list[Trial]:
    """Every method on every seed: one training lap, then two corridors with other blocks."""
    return [
        Trial(METHODS[name], WORLD, seed, laps=1, all_laps=True, unseen=2) for name in NAMES for seed in range(seeds)
    ]


def row(group: Sequence[Outcome]) -> Row:
    """Means over the seeds, as in the thesis. The first demonstration is the human's, too, and counted apart."""
    first = [outcome.after(1) for outcome in group]
    unseen = [lap for outcome in group for lap in outcome.laps if lap.phase == Phase.UNSEEN]
    return {
        "n": len(group),
        "buffer": mean([lap.buffer for lap in first]),
        "demonstration": mean([outcome.result.demonstration for outcome in group]),
        "human_labels": mean([lap.human_labels for lap in first]),
        "interventions": mean([lap.interventions for lap in first]),
        "collisions_taught": mean([lap.collisions for lap in first]),
        "passed_same": sum(outcome.result.converged for outcome in group),
        "collisions_afterwards": mean([lap.collisions + lap.lost for lap in unseen]),
        "passed_other": sum(lap.passed for lap in unseen),
        "other_drives": len(unseen),
    }


def mean(values: Sequence[float]) -> float:
    """Mean to one decimal."""
    return round(float(np.mean(values)), 1)


def tables(outcomes: Outcomes) -> list[Table]:
    """The methods beside the thesis's."""
    thesis: list[Row] = [{"method": f"thesis: {name}", "n": 3} | dict(each) for name, each in THESIS.items()]
    note = (
        "Means. Afterwards: per drive through another corridor, where a robot that hits a block or loses the way is "
        "put down behind it. The thesis had 9.7 human labels printed for HG-DAgger; it must be its buffer."
    )
    return [
        Table("One training lap through the corridor", [*method_rows(outcomes, row), *thesis], note),
        Table("Calls and the human's time", method_rows(outcomes, effort_row)),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """LIRA-SPF fills a larger buffer with fewer of the human's labels and interventions."""
    groups = {method: row(group) for method, group in by_method(outcomes).items()}
    found = []
    for preset in NAMES[:2]:
        for quantity, more in (("buffer", True), ("human_labels", False), ("interventions", False)):
            ours, rival = (float(str(groups[name][quantity])) for name in (preset, "hg-dagger"))
            theirs = f"{THESIS['LIRA-SPF'][quantity]} to {THESIS['HG-DAgger'][quantity]}"
            claim = f"{preset} against HG-DAgger, {quantity.replace('_', ' ')}: {'more' if more else 'fewer'}"
            agrees = ours > rival if more else ours < rival
            found.append(Finding(f"table3.{preset}.{quantity}", claim, theirs, f"{ours:g} to {rival:g}", agrees))
    return found


def figures(outcomes: Outcomes) -> list[Picture]:
    """Human labels and interventions by method."""
    return box_pictures(by_method(outcomes), ("human_labels", "interventions"))


EXPERIMENTS = {"table3": Experiment(trials=trials, tables=tables, findings=findings, figures=figures)}
