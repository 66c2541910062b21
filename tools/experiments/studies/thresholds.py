"""Tables C.1 and C.2: LIRA-SPF on the figure-eight at 0.5 m/s, two laps, for other thresholds."""

from collections.abc import Sequence
from functools import partial
from itertools import combinations

import numpy as np

from lira.fusion.learning.novice import LearningSettings
from lira.fusion.methods.lira import LiraSettings
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Picture, Row, Table
from lira.tools.experiments.trial import Preset, Trial

Printed = dict[tuple[int, int], tuple[int, int, int | None]]
# (theta, L) in per cent -> the thesis's buffer and training steps after lap 1 and 2; C.2 gives no steps.
# Table C.1 has the redundancy filter off.
THESIS_C1: Printed = {(1, 0): (570, 998, 33), (3, 0): (77, 124, 4), (6, 0): (30, 30, 1), (10, 0): (30, 30, 1)}
THESIS_C2: Printed = {(1, 5): (83, 99, None), (1, 3): (167, 228, None), (3, 5): (52, 61, None), (3, 3): (54, 73, None)}
THESIS = {"tableC1": THESIS_C1, "tableC2": THESIS_C2}
HOLD = {"thesis": None, "hold": LiraSettings().hold}
# What is played: a preset, with a camera expert taught by a bang-bang hand with faults, as the thesis's was (the task
# "eight"), or by a perfect, proportional one (the task "line").
PLAYED = (("thesis", "eight"), ("hold", "eight"), ("thesis", "line"))
CLEAR = 5.0  # C.1: the buffer falls by at least so much from the first theta to the second


def trials(seeds: int, table: str) -> list[Trial]:
    """Every row of a table on every seed, for each preset and pair of experts."""
    return [
        Trial(method(preset, *row), "eight", seed, laps=2, all_laps=True, unseen=0, max_linear_m_s=0.5, experts=experts)
        for row in THESIS[table]
        for preset, experts in PLAYED
        for seed in range(seeds)
    ]


def method(preset: str, theta: int, redundancy: int) -> Preset:
    """LIRA-SPF with thresholds in per cent."""
    name = f"lira-{preset}-theta{theta}-L{redundancy}"
    return Preset(
        name, LiraSettings(theta=theta / 100, hold=HOLD[preset]), LearningSettings(redundancy=redundancy / 100)
    )


def summary(outcomes: Outcomes, table: str) -> list[Row]:
    """One row per threshold: medians over the seeds after laps 1 and 2 beside the thesis's."""
    rows: list[Row] = []
    for (theta, redundancy), (first, second, steps) in THESIS[table].items():
        for preset, experts in PLAYED:
            played = method(preset, theta, redundancy).name, experts
            group = [each for each in outcomes if (each.trial.method.name, each.trial.pair) == played]
            rows.append(
                {
                    "preset": preset,
                    "experts": experts,
                    "theta_percent": theta,
                    "redundancy_percent": redundancy,
                    "n": len(group),
                    "buffer_lap1": float(np.median([each.after(1).buffer for each in group])),
                    "buffer_lap2": float(np.median([each.after(2).buffer for each in group])),
                    "training_steps_lap2": float(np.median([each.after(2).training_steps for each in group])),
                    "human_labels_lap2": float(np.median([each.after(2).human_labels for each in group])),
                    "thesis_lap1": first,
                    "thesis_lap2": second,
                    "thesis_steps_lap2": steps,
                }
            )
    return rows


def tables(outcomes: Outcomes, table: str) -> list[Table]:
    """Ours and the thesis's side by side."""
    return [Table("Buffer after one and two laps of the figure-eight (medians)", summary(outcomes, table))]


def findings(outcomes: Outcomes, table: str) -> list[Finding]:
    """The order of the buffers and, for C.1, how far the first step of theta brings them down."""
    found: list[Finding] = []
    rows = summary(outcomes, table)
    for preset, experts in PLAYED:
        ours = buffers(rows, preset, experts)
        theirs = [second for _, second, _ in THESIS[table].values()]
        labels = ", ".join(f"({theta}, {redundancy})" for theta, redundancy in THESIS[table])
        found.append(
            Finding(
                key=f"{table}.{preset}.{experts}.order",
                claim=f"order of the buffers after two laps at (theta, L) = {labels} %, {preset}, experts {experts}",
                thesis=" ".join(map(str, theirs)),
                ours=" ".join(f"{each:g}" for each in ours),
                agrees=in_order(ours, theirs),
            )
        )
        if table == "tableC1":
            found.append(
                Finding(
                    key=f"{table}.{preset}.{experts}.fall",
                    claim=f"buffer after two laps at theta 1 % over 3 %, {preset}, experts {experts} "
                    f"(agrees from {CLEAR:g} on)",
                    thesis=f"{theirs[0] / theirs[1]:.1f}",
                    ours=f"{ours[0] / ours[1]:.1f}",
                    agrees=ours[0] / ours[1] >= CLEAR,
                )
            )
    return found


def buffers(rows: Sequence[Row], preset: str, experts: str) -> list[float]:
    """Buffers after two laps, in the order of the thesis's table."""
    return [float(str(row["buffer_lap2"])) for row in rows if (row["preset"], row["experts"]) == (preset, experts)]


def in_order(ours: list[float], theirs: list[int]) -> bool:
    """Whether no two of ours stand the other way round than theirs."""
    pairs = combinations(zip(ours, theirs, strict=True), 2)
    return all((a - b) * (x - y) >= 0 for (a, x), (b, y) in pairs)


def figures(outcomes: Outcomes, table: str) -> list[Picture]:
    """Buffers after two laps as bars beside the thesis's."""
    from lira.tools.experiments.output import plots

    rows = summary(outcomes, table)
    names = [f"theta {theta} %, L {redundancy} %" for theta, redundancy in THESIS[table]]
    ours = {f"ours, {preset}, experts {experts}": buffers(rows, preset, experts) for preset, experts in PLAYED}
    series = {**ours, "thesis": [float(second) for _, second, _ in THESIS[table].values()]}
    words = "Labels in the buffer after two laps"
    return [Picture("buffer", words, partial(plots.paired_bars, names, series, "labels"))]


EXPERIMENTS = {
    table: Experiment(
        trials=partial(trials, table=table),
        tables=partial(tables, table=table),
        findings=partial(findings, table=table),
        figures=partial(figures, table=table),
    )
    for table in THESIS
}
