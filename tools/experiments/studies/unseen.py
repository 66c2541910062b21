"""What it takes until the novice passes layouts that nobody has taught it: methods compared at equal quality.

Every method is taught until its novice alone passes 11 of 12 fresh layouts, or up to the cap of laps (censored): its
effort is the effort to that quality. Then 12 other layouts, which decided nothing, say what the quality is. How a
method is taught is its own: on one layout as in the thesis (hold, hg-dagger), or each lap on a fresh one (plus,
-fresh, -kernel). HG-DAgger with plus's novice tells what the experts bring apart from what the learner brings.
"""

from collections.abc import Sequence

from msgspec.structs import replace

from lira.fusion.methods.presets import METHODS, Preset
from lira.fusion.methods.syllabus import with_proof
from lira.hal.messages import Phase
from lira.tools.experiments import pairs
from lira.tools.experiments.experiment import Experiment, Outcomes, Picture, Row, Table
from lira.tools.experiments.measures import by_method, driving_row, effort_row, label_row, median, method_rows
from lira.tools.experiments.pairs import TOTAL
from lira.tools.experiments.pictures import box_pictures
from lira.tools.experiments.trial import Outcome, Trial
from lira.tools.output.proven import share

WORLD = "line-obstacles"
QUALITY, PROOF, SHOWN = 0.9, "fresh:11/12", 12
BASE = "plus"
USUAL = (BASE, "hold", "hg-dagger", "hg-dagger-kernel")
NAMES = (*USUAL, "hold-kernel", "hg-dagger-fresh", "hg-dagger-warm-m10-mirrored", "plus-network", "plus-own")
QUANTITIES = ("human_labels", "interventions", TOTAL)


def to_quality(name: str) -> Preset:
    """A method that is taught until its novice is as good as all others."""
    method = METHODS[name]
    return replace(method, syllabus=with_proof(method.syllabus, PROOF))


def trials(seeds: int) -> list[Trial]:
    """Each method on every seed."""
    return [Trial(to_quality(name), WORLD, seed, unseen=SHOWN) for name in NAMES for seed in range(seeds)]


def by_name(outcomes: Outcomes) -> dict[str, list[Outcome]]:
    """Outcomes of each method in one order of pairs and seeds, somebody's own after those of the project."""
    ordered = sorted(outcomes, key=lambda each: (each.trial.pair, each.trial.seed))
    groups = by_method(ordered)
    return {name: groups[name] for name in (*NAMES, *(name for name in groups if name not in NAMES)) if name in groups}


def quality_row(group: Sequence[Outcome]) -> Row:
    """Effort, medians with the 90 % quantile and the worst; and the unseen layouts, with the share's 95 % interval."""
    final = [outcome.result for outcome in group]
    unseen = [lap for outcome in group for lap in outcome.laps if lap.phase == Phase.UNSEEN]
    passed = sum(lap.passed for lap in unseen)
    low, high = share(passed, len(unseen))
    row: Row = {"n": len(group)}
    for quantity in ("human_labels", "interventions"):
        values = sorted(getattr(result, quantity) for result in final)
        tail = values[min(len(values) - 1, round(0.9 * (len(values) - 1)))]
        row |= {quantity: median(values), f"{quantity}_90": tail, f"{quantity}_max": values[-1]}
    return row | {
        "demonstration": median([result.demonstration for result in final]),
        "laps": median([result.laps for result in final]),
        "unseen_laps": len(unseen),
        "unseen_passed": passed,
        "share_low": low,
        "share_high": high,
        "collisions": sum(lap.collisions for lap in unseen),
        "lost": sum(lap.lost for lap in unseen),
        "censored": sum(not result.converged for result in final),
    }


def quality(outcomes: Outcomes) -> list[Row]:
    """One row per method and pair of experts."""
    return [
        {"method": name, "pair": pair} | quality_row([each for each in group if each.trial.pair == pair])
        for name, group in by_name(outcomes).items()
        for pair in dict.fromkeys(each.trial.pair for each in group)
    ]


def ratios(outcomes: Outcomes) -> list[Row]:
    """Every method's effort over that of plus, pair by pair of one seed and one pair of experts."""
    groups = by_name(outcomes)
    compared = [(BASE, name) for name in groups if name != BASE]
    return [{**row, "quality": QUALITY} for row in pairs.ratios(groups, compared, QUANTITIES)]


def tables(outcomes: Outcomes) -> list[Table]:
    """Effort and quality, ratios, what else it took, how it was driven."""
    words = f"Human labels and interventions until {PROOF[6:].replace('/', ' of ')} fresh layouts were passed"
    return [
        Table(words, quality(outcomes), "Unseen: 12 other layouts a run. Censored runs count with what they had used."),
        Table("Over plus, by pairs of one seed", ratios(outcomes), "A censored pair's true ratio may lie higher."),
        Table("Labels and training", method_rows(outcomes, label_row)),
        Table("Calls and the human's time", method_rows(outcomes, effort_row)),
        Table("Driving", method_rows(outcomes, driving_row)),
    ]


def figures(outcomes: Outcomes) -> list[Picture]:
    """Human labels and interventions by method."""
    return box_pictures(by_name(outcomes), QUANTITIES[:2])


EXPERIMENTS = {
    "unseen": Experiment(
        trials=trials,
        tables=tables,
        findings=lambda _: [],  # the thesis tells of no layouts that were not taught
        figures=figures,
        ratios=ratios,
        quality=quality,
        methods=NAMES,
        usual=USUAL,
    )
}
