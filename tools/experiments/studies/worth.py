"""What one choice is worth: a base, and what differs from it in one thing, pair by pair of one seed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lira.fusion.methods.presets import METHODS, PLUS
from lira.tools.experiments.effort import pairs
from lira.tools.experiments.effort.equal_quality import effort_rows, quality_rows, reached, way_rows
from lira.tools.experiments.effort.measures import by_method, driving_row, label_row, method_rows
from lira.tools.experiments.effort.measures import effort_row as used_row
from lira.tools.experiments.experiment import Experiment, Outcomes, Picture, Row, Table
from lira.tools.experiments.output.pictures import box_pictures
from lira.tools.experiments.quality import Quality
from lira.tools.experiments.studies import unseen
from lira.tools.experiments.trial import Outcome, Trial

WORLD = "line-obstacles"
QUANTITIES = ("human_labels", "interventions", "calls")


@dataclass(frozen=True, slots=True)
class Worth:
    """`bases` and their variants by name. With `experts` pairs, each of them on every seed; to a `quality`, or by each
    method's own proof.
    """

    bases: Mapping[str, Sequence[str]]
    experts: Sequence[str | None] = (None,)
    quality: Quality | None = None

    @property
    def names(self) -> list[str]:
        """Bases, each with its variants behind it."""
        return [name for base, variants in self.bases.items() for name in (base, *variants)]

    def trials(self, seeds: int) -> list[Trial]:
        """Every base and every variant, with each pair of experts, on every seed."""
        return [self._trial(name, pair, seed) for name in self.names for pair in self.experts for seed in range(seeds)]

    def _trial(self, name: str, pair: str | None, seed: int) -> Trial:
        if self.quality is None:
            return Trial(METHODS[name], WORLD, seed, experts=pair)
        method, layouts = unseen.to_quality(name), self.quality.layouts
        return Trial(method, WORLD, seed, laps=unseen.LAPS, unseen=layouts, experts=pair, quality=self.quality)

    def groups(self, outcomes: Outcomes) -> dict[str, list[Outcome]]:
        """Outcomes of each method in one order of pairs and seeds."""
        found = by_method(outcomes)
        return {
            name: sorted(found[name], key=lambda each: (each.trial.pair, each.trial.seed))
            for name in self.names
            if name in found
        }

    def ratios(self, outcomes: Outcomes) -> list[Row]:
        """Each variant over its base; at equal quality, to the lowest level."""
        compared = [(base, variant) for base, variants in self.bases.items() for variant in variants]
        groups = self.groups(outcomes)
        if self.quality is None:
            return pairs.ratios(groups, compared, QUANTITIES)
        level = self.quality.levels[0]
        rows = pairs.ratios(groups, compared, QUANTITIES, lambda outcome: reached(outcome, level))
        return [{**row, "quality": level} for row in rows]

    def tables(self, outcomes: Outcomes) -> list[Table]:
        """Bases and variants, and the ratios."""
        ratios = Table(
            "Variant over base, by pairs of one seed", self.ratios(outcomes), "Above 1 the variant takes more."
        )
        if self.quality is None:
            return [
                Table("Labels and interventions", method_rows(outcomes, label_row)),
                ratios,
                Table("Calls and the human's time", method_rows(outcomes, used_row)),
                Table("Driving", method_rows(outcomes, driving_row)),
            ]
        groups, levels = self.groups(outcomes), self.quality.levels
        efforts = [Table(f"Effort to {level:.0%} of fresh layouts", effort_rows(groups, level)) for level in levels]
        return [*efforts, ratios, Table(f"Deployed, from {levels[0]:.0%} on", way_rows(groups, levels[0]))]

    def quality_rows(self, outcomes: Outcomes) -> list[Row]:
        """Effort to the lowest level and what that is worth, by method and pair."""
        return [] if self.quality is None else quality_rows(self.groups(outcomes), self.quality.levels[0])

    def figures(self, outcomes: Outcomes) -> list[Picture]:
        """Human labels and interventions by method."""
        return box_pictures(self.groups(outcomes), QUANTITIES[:2])

    def experiment(self) -> Experiment:
        """Return it as an experiment, whose methods may be played alone. The thesis has no such numbers."""
        return Experiment(
            trials=self.trials,
            tables=self.tables,
            findings=lambda _: [],
            figures=self.figures,
            ratios=self.ratios,
            quality=self.quality_rows,
            methods=tuple(self.names),
        )


# `plus` with other experts than any choice was made on: each of its parts left out.
ABLATION = Worth(
    {"plus": [each.name for each in PLUS if each.name.startswith("plus-no-")] + ["plus-network", "plus-own"]},
    experts=("line@1", "line@2", "line@3"),
    quality=Quality(ways=("plain", "shield")),
)
VARIANTS = Worth(
    {
        "hold": ("hold-mirrored",),
        "plus": ("plus-ask", "plus-practice", "plus-sure"),
        "hg-dagger": ("hg-dagger-trunks", "hg-dagger-mirrored", "hg-dagger-doubt"),
    }
)
EXPERIMENTS = {"ablation": ABLATION.experiment(), "variants": VARIANTS.experiment()}
