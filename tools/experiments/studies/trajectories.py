"""Figure E.6: where the final novices drove on the race, and how fast."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from lira.hal.messages import Phase
from lira.tools.experiments.effort.measures import by_method, known, method_rows, time_to_finish_s
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Picture, Row, Table
from lira.tools.experiments.methods import DRAWN
from lira.tools.experiments.notes import Track
from lira.tools.experiments.studies.compare import trials
from lira.tools.experiments.trial import Outcome


def final(outcome: Outcome) -> Track | None:
    """The last proving run; None if the novice never came to one."""
    return next((track for track in reversed(outcome.tracks) if track.phase == Phase.PROVE), None)


def rows(outcomes: Outcomes) -> list[Row]:
    """One row per method, over the final proving runs."""
    return method_rows(outcomes, row)


def row(group: Sequence[Outcome]) -> Row:
    """How the last proving runs went; medians over the seeds."""
    laps = [next((lap for lap in reversed(o.laps) if lap.phase == Phase.PROVE), None) for o in group]
    tracks = [track for track in map(final, group) if track is not None]
    speeds = [float(np.mean(track.speed_mm_s)) / 1000 for track in tracks]
    return {
        "n": len(group),
        "passed": sum(lap is not None and lap.passed for lap in laps),
        "lateral_rms_m": known([lap.lateral_rms_m for lap in laps if lap is not None]),
        "time_to_finish_s": known([time_to_finish_s(lap) for lap in laps if lap is not None]),
        "mean_speed_m_s": known(speeds),
    }


def tables(outcomes: Outcomes) -> list[Table]:
    """How the final novices drove."""
    return [Table("Final proving runs", rows(outcomes), "The thesis shows these drives as pictures, without numbers.")]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Every final novice finishes (IV-C: training goes on until it does)."""
    return [
        Finding(
            f"trajectories.{each['method']}.finishes",
            f"{each['method']}: the final novice drives the 120 m without help",
            "always",
            f"{each['passed']} of {each['n']}",
            each["passed"] == each["n"],
        )
        for each in rows(outcomes)
    ]


def figures(outcomes: Outcomes) -> list[Picture]:
    """The first seed's final drives of every method, on one layout."""
    from lira.tools.experiments.output import plots

    firsts = {method: group[0] for method, group in by_method(outcomes).items()}
    tracks = {method: track for method, first in firsts.items() if (track := final(first)) is not None}
    trial = outcomes[0].trial
    words = f"Final novices on layout {trial.seed}; the colour is the speed, a dot a decision (thesis, E.6)"
    return [Picture("drives", words, partial(plots.top_view, trial.world, tracks, trial.profile.base.max_linear_m_s))]


EXPERIMENTS = {
    "trajectories": Experiment(
        trials=lambda seeds: trials(seeds, "race", DRAWN),
        tables=tables,
        findings=findings,
        figures=figures,
    )
}
