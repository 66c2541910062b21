"""Figures E.4 and E.5: which labels were learned from, by who gave them, on the race."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from lira.fusion.log.counts import DEMONSTRATION
from lira.hal.messages import Action, Driver
from lira.tools.experiments.effort.measures import by_method
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Picture, Row, Table
from lira.tools.experiments.methods import DRAWN, FUSED, HG_DAGGER
from lira.tools.experiments.studies.compare import trials
from lira.tools.experiments.trial import Outcome
from lira.tools.report.plots import BINS

HUMAN = (Driver.HUMAN, DEMONSTRATION)
FULL = 0.9  # from here on an action is full speed, or full steer
STRAIGHT = 0.1  # up to here it goes straight on; between the two lies the mid-range
EVEN = (0.35, 0.65)  # a share that is "almost equal"
ALIKE = 0.25  # distance of two densities that are "very similar"; 0 is equal, 1 has nothing in common


def by_source(group: Sequence[Outcome]) -> dict[str, list[Action]]:
    """Stored labels of all runs: the human's, the demonstration included, and the experts'."""
    labels: dict[str, list[Action]] = {"human": [], "experts": []}
    for outcome in group:
        for source, actions in outcome.labels.items():
            labels["human" if source in HUMAN else "experts"] += actions
    return labels


def row(method: str, source: str, labels: Sequence[Action], runs: int) -> Row:
    """One source of one method: how many labels, and shares of kinds of them."""
    linear, angular = np.array(labels, dtype=float).reshape(-1, 2).T
    turn = np.abs(angular)
    some = len(labels) > 0
    return {
        "method": method,
        "source": source,
        "labels_per_run": len(labels) / runs,
        "full_speed": float((linear >= FULL).mean()) if some else None,
        "backward": float((linear < 0.0).mean()) if some else None,
        "straight": float((turn <= STRAIGHT).mean()) if some else None,
        "mid_range_turn": float(((turn > STRAIGHT) & (turn < FULL)).mean()) if some else None,
        "full_turn": float((turn >= FULL).mean()) if some else None,
    }


def rows(outcomes: Outcomes) -> list[Row]:
    """Sources of every method that have any label."""
    found = []
    for method, group in by_method(outcomes).items():
        found += [row(method, source, labels, len(group)) for source, labels in by_source(group).items() if labels]
    return found


def tables(outcomes: Outcomes) -> list[Table]:
    """Shares of the stored labels."""
    note = f"Shares of the labels of a row; full: {FULL:g} of the limit or more, straight: up to {STRAIGHT:g}."
    return [Table("Stored labels by source", rows(outcomes), note)]


def distance(one: Sequence[Action], other: Sequence[Action], axis: int) -> float:
    """Total variation distance of two densities on one axis of the action: 0 if equal, 1 if disjoint."""
    edges = np.linspace(-1.0, 1.0, BINS + 1)
    densities = [np.histogram([each[axis] for each in labels], bins=edges)[0] / len(labels) for labels in (one, other)]
    return float(np.abs(densities[0] - densities[1]).sum() / 2)


def findings(outcomes: Outcomes) -> list[Finding]:
    """The statements of E.3, each with a number."""
    groups = {method: by_source(group) for method, group in by_method(outcomes).items()}
    hg_dagger = groups[HG_DAGGER[0].name]["human"]
    found = []
    for name in (each.name for each in FUSED):
        human, experts = groups[name]["human"], groups[name]["experts"]
        everyone = [*human, *experts]
        full = float(np.mean([linear >= FULL for linear, _ in everyone]))
        share = len(human) / len(everyone)
        mid = {who: mid_range(labels) for who, labels in (("human", human), ("experts", experts))}
        apart = distance(everyone, hg_dagger, 1)
        key = f"labels.{name}"
        found += [
            Finding(f"{key}.speed", f"{name}: most labels have full speed", "most", f"{full:.0%}", full > 0.5),
            Finding(
                f"{key}.share",
                f"{name}: human and experts give about as many (agrees from {EVEN[0]:.0%} to {EVEN[1]:.0%})",
                "almost equal",
                f"{share:.0%} from the human",
                EVEN[0] <= share <= EVEN[1],
            ),
            Finding(
                f"{key}.mid_range",
                f"{name}: experts give more mid-range turns than the human",
                "much more",
                f"experts {mid['experts']:.0%}, human {mid['human']:.0%}",
                mid["experts"] > mid["human"],
            ),
            Finding(
                f"{key}.alike",
                f"{name} and HG-DAgger: the turns in the buffers are alike (agrees up to a distance of {ALIKE:g})",
                "almost similar",
                f"total variation distance {apart:.2f}",
                apart <= ALIKE,
            ),
        ]
    backward = float(np.mean([linear < 0.0 for linear, _ in hg_dagger]))
    found.append(
        Finding(
            "labels.hg-dagger.backward",
            "HG-DAgger's buffer holds labels that drive backward",
            "some",
            f"{backward:.1%}",
            backward > 0.0,
        )
    )
    return found


def mid_range(labels: Sequence[Action]) -> float:
    """Share of labels that turn neither hardly nor fully."""
    return float(np.mean([STRAIGHT < abs(angular) < FULL for _, angular in labels])) if labels else 0.0


def figures(outcomes: Outcomes) -> list[Picture]:
    """E.4 for each method that has experts, and E.5."""
    from lira.tools.experiments.output import plots

    groups = by_method(outcomes)
    runs = len(groups[HG_DAGGER[0].name])
    pictures = [
        Picture(
            name, f"{name}: labels by source (thesis, E.4)", partial(plots.densities, by_source(groups[name]), runs)
        )
        for name in (each.name for each in FUSED)
    ]
    everyone = {
        each.name: [action for labels in by_source(groups[each.name]).values() for action in labels] for each in DRAWN
    }
    return [*pictures, Picture("methods", "Labels by method (thesis, E.5)", partial(plots.densities, everyone, runs))]


EXPERIMENTS = {
    "labels": Experiment(
        trials=lambda seeds: trials(seeds, "race", DRAWN),
        tables=tables,
        findings=findings,
        figures=figures,
    )
}
