"""What it takes until the novice passes layouts that nobody has taught it: methods compared at equal quality.

After each training lap every method's novice drives 12 fresh layouts alone: a point of its curve. Its effort to 90 % is
what it had taken when it passed 11 of them, to 97 % when it passed all 12; who does not get there within the cap of
laps (12, or `--laps`) is censored. Then 12 other layouts, which decided nothing, say what that is worth. How a method
is taught is its own: on one layout as in the thesis (hold, hg-dagger), or each lap on a fresh one (plus, -fresh,
-kernel). The rivals with the novice of plus tell what the experts bring apart from what the learner brings.
"""

from functools import partial

from msgspec.structs import replace

from lira.fusion.methods.presets import METHODS, RIVALS, Preset
from lira.fusion.methods.syllabus import with_proof
from lira.tools.experiments.effort import equal_quality
from lira.tools.experiments.effort.equal_quality import (
    curve_rows,
    curve_table,
    effort_rows,
    more_rows,
    quality_rows,
    ratio_rows,
    way_rows,
)
from lira.tools.experiments.effort.measures import by_method
from lira.tools.experiments.experiment import Experiment, Outcomes, Picture, Row, Table
from lira.tools.experiments.quality import Quality
from lira.tools.experiments.trial import Outcome, Trial

WORLD = "line-obstacles"
LAPS = 12  # the cap: who is cut off counts with less than the whole effort, so it lies well above what most take
TO = Quality(ways=("plain", "shield"))
BASE = "plus"
USUAL = (BASE, "hold", "hg-dagger", "hg-dagger-kernel")
NAMES = (
    *USUAL,
    *("hold-kernel", "hg-dagger-m10", "hg-dagger-warm-m10", "hg-dagger-warm-m10-mirrored"),
    *(f"{method.name}{kind}" for method in RIVALS for kind in ("", "-fresh", "-kernel") if method.name != "hg-dagger"),
    *("hg-dagger-fresh", "plus-network", "plus-own"),
)


def to_quality(name: str) -> Preset:
    """A method that is taught until its novice is as good as all others."""
    method = METHODS[name]
    return replace(method, syllabus=with_proof(method.syllabus, f"fresh:{TO.layouts}"))


def trials(seeds: int, names: tuple[str, ...] = NAMES) -> list[Trial]:
    """Each method on every seed."""
    return [
        Trial(to_quality(name), WORLD, seed, laps=LAPS, unseen=TO.layouts, quality=TO)
        for name in names
        for seed in range(seeds)
    ]


def by_name(outcomes: Outcomes) -> dict[str, list[Outcome]]:
    """Outcomes of each method in one order of pairs and seeds, somebody's own after those of the project."""
    ordered = sorted(outcomes, key=lambda each: (each.trial.pair, each.trial.seed))
    groups = by_method(ordered)
    groups = {
        name: sorted(group, key=lambda each: (each.trial.pair, each.trial.seed)) for name, group in groups.items()
    }
    return {name: groups[name] for name in (*NAMES, *(name for name in groups if name not in NAMES)) if name in groups}


def quality(outcomes: Outcomes) -> list[Row]:
    """Effort to 90 %, and what that is worth: one row per method and pair of experts."""
    return quality_rows(by_name(outcomes), TO.levels[0])


def ratios(outcomes: Outcomes) -> list[Row]:
    """Every method's effort over that of plus, to each level."""
    groups = by_name(outcomes)
    return [row for level in TO.levels for row in ratio_rows(groups, BASE, level)]


def curves(outcomes: Outcomes) -> list[Row]:
    """The share of fresh layouts passed against what it took."""
    return curve_rows(by_name(outcomes))


def pairs_of(outcomes: Outcomes) -> set[str]:
    """Whose experts took part."""
    return {each.trial.pair for each in outcomes}


def tables(outcomes: Outcomes) -> list[Table]:
    """Effort and quality, ratios, curves, ways of deployment."""
    groups = by_name(outcomes)
    cut = "Who did not get there counts as censored, with what it had used. Unseen: 12 other layouts a run."
    found = [
        *(Table(f"Effort to {level:.0%} of fresh layouts", effort_rows(groups, level), cut) for level in TO.levels),
        Table("The same by pairs of experts", quality(outcomes) if len(pairs_of(outcomes)) > 1 else []),
        Table("Over plus, by pairs of one seed", ratios(outcomes), "A censored pair's true ratio may lie higher."),
        *(
            Table(f"Fresh layouts passed, in percent, at so many {quantity.replace('_', ' ')}", rows)
            for quantity in equal_quality.ALONG
            for rows in [curve_table(curve_rows(groups), quantity)]
        ),
        Table("Deployed, from 90 % on", way_rows(groups, TO.levels[0]), "On the 12 layouts that decided nothing."),
        Table("Taught on after it was proven", more_rows(groups)),
    ]
    return [table for table in found if table.rows]


def figures(outcomes: Outcomes) -> list[Picture]:
    """The curves."""
    from lira.tools.experiments.output import plots

    rows = curves(outcomes)
    return [
        Picture(
            quantity,
            f"Fresh layouts that the novice passed alone, against {quantity.replace('_', ' ')}; means over the runs",
            partial(plots.curves, [row for row in rows if row["quantity"] == quantity]),
        )
        for quantity in equal_quality.ALONG
    ]


EXPERIMENTS = {
    "unseen": Experiment(
        trials=trials,
        tables=tables,
        findings=lambda _: [],  # the thesis tells of no layouts that were not taught
        figures=figures,
        ratios=ratios,
        quality=quality,
        curves=curves,
        methods=NAMES,
        usual=USUAL,
    )
}
