"""Table I: what it takes to train the two experts of the passage from scratch, and then the novice with them."""

from collections.abc import Sequence

import numpy as np

from lira.fusion.experts.files import experts_of
from lira.fusion.experts.load import load_network
from lira.fusion.methods.presets import METHODS
from lira.tools.experiments.effort.measures import by_method
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Row, Table
from lira.tools.experiments.trial import Trial

WORLD = "passage"
EXPERTS = f"{WORLD}@0"  # not those that come with the project, but made by the same commands
PRESETS = ("thesis", "hold")
# Table I as printed: labels and training steps.
THESIS = {"lidar expert": (210, 7), "camera expert": (270, 9), "novice": (30, 1)}


def trials(seeds: int) -> list[Trial]:
    """A novice of each seed; its experts are trained once, as in the thesis, and from scratch."""
    return [
        Trial(METHODS[preset], WORLD, seed, unseen=0, experts=EXPERTS) for preset in PRESETS for seed in range(seeds)
    ]


def rows(outcomes: Outcomes) -> list[Row]:
    """One row per policy: medians over the seeds beside the thesis's."""
    groups = by_method(outcomes)
    trial = outcomes[0].trial
    files = {
        name: load_network(f"{name}-expert", trial.profile, trial.pair)[1]
        for name in reversed(experts_of(trial.profile))
    }
    taken = {f"{name} expert": [(file.labels or 0, file.training_steps or 0)] for name, file in files.items()}
    for preset, group in groups.items():
        taken[f"novice, {preset}"] = [(each.result.buffer, each.result.training_steps) for each in group]
    return [row(policy, pairs) for policy, pairs in taken.items()]


def row(policy: str, pairs: Sequence[tuple[int, int]]) -> Row:
    """Labels and training steps of one policy over the seeds."""
    labels, steps = np.median(np.asarray(pairs), axis=0)
    low, high = min(labels for labels, _ in pairs), max(labels for labels, _ in pairs)
    thesis_labels, thesis_steps = THESIS[policy.partition(",")[0]]
    return {
        "policy": policy,
        "n": len(pairs),
        "labels": float(labels),
        "labels_range": f"{low}-{high}",
        "training_steps": float(steps),
        "thesis_labels": thesis_labels,
        "thesis_steps": thesis_steps,
    }


def tables(outcomes: Outcomes) -> list[Table]:
    """Ours and the thesis's."""
    censored = sum(not outcome.result.converged for outcome in outcomes)
    note = f"Medians. Labels count the first demonstration. {censored} of {len(outcomes)} novices never passed."
    return [Table("Labels and training steps of the passage's policies", rows(outcomes), note)]


def findings(outcomes: Outcomes) -> list[Finding]:
    """A novice takes far fewer labels than its experts did (30 against 480)."""
    ours = {str(each["policy"]): float(str(each["labels"])) for each in rows(outcomes)}
    experts = sum(ours[f"{name} expert"] for name in experts_of(outcomes[0].trial.profile))
    found = []
    for preset in by_method(outcomes):
        novice = ours[f"novice, {preset}"]
        words = f"{novice:g} to {experts:g}"
        claim = f"{preset}: the novice takes less than half of its experts' labels"
        found.append(Finding(f"table1.{preset}.fewer", claim, "30 to 480", words, novice < experts / 2))
    return found


EXPERIMENTS = {"table1": Experiment(trials=trials, tables=tables, findings=findings)}
