"""Tables C.1 and C.2: LIRA-SPF on the figure-eight at 0.5 m/s, two laps, for other thresholds."""

from collections.abc import Sequence

import numpy as np

from fusion.lira import LiraSettings
from fusion.novice import LearningSettings
from tools.experiments.trial import Method, Outcome, Trial

# (theta, L) in per cent -> the thesis's buffer after lap 1 and 2. Table C.1 has the redundancy filter off.
THESIS_C1 = {(1, 0): (570, 998), (3, 0): (77, 124), (6, 0): (30, 30), (10, 0): (30, 30)}
THESIS_C2 = {(1, 5): (83, 99), (1, 3): (167, 228), (3, 5): (52, 61), (3, 3): (54, 73)}
THESIS = {"tableC1": THESIS_C1, "tableC2": THESIS_C2}


def trials(table: str, seeds: int) -> list[Trial]:
    """Every row of a table on every seed, in the thesis's preset and with `hold`."""
    rows = [(theta, keep, hold) for theta, keep in THESIS[table] for hold in (None, 0.2)]
    return [
        Trial(_method(*row), "eight", seed, laps=2, all_laps=True, unseen=0, max_linear_m_s=0.5)
        for row in rows
        for seed in range(seeds)
    ]


def _method(theta: int, redundancy: int, hold: float | None) -> Method:
    preset = "thesis" if hold is None else "hold"
    name = f"lira-{preset}-theta{theta}-L{redundancy}"
    return Method(name, LiraSettings(theta=theta / 100, hold=hold), LearningSettings(redundancy=redundancy / 100))


def summary(table: str, outcomes: Sequence[Outcome]) -> list[dict[str, object]]:
    """One row per threshold: the buffer after laps 1 and 2 beside the thesis's."""
    rows: list[dict[str, object]] = []
    for (theta, redundancy), (first, second) in THESIS[table].items():
        for hold in (None, 0.2):
            name = _method(theta, redundancy, hold).name
            laps = [outcome for outcome in outcomes if outcome.trial.method.name == name]
            rows.append(
                {
                    "preset": "thesis" if hold is None else "hold",
                    "theta_percent": theta,
                    "redundancy_percent": redundancy,
                    "n": len(laps),
                    "buffer_lap1": float(np.median([each.after(1).buffer for each in laps])),
                    "buffer_lap2": float(np.median([each.after(2).buffer for each in laps])),
                    "training_steps_lap2": float(np.median([each.after(2).training_steps for each in laps])),
                    "thesis_lap1": first,
                    "thesis_lap2": second,
                }
            )
    return rows
