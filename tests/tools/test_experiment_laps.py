"""The table of what more teaching does, of made-up outcomes."""

import pytest
from made_up_outcomes import lap, outcome

from lira.tools.experiments.registry import load
from lira.tools.experiments.studies import laps


def test_every_novice_is_shown_as_many_layouts_after_every_lap():
    trials = load("laps").trials(2)
    assert [(trial.method.name, trial.seed) for trial in trials] == [(n, s) for n in laps.NAMES for s in (0, 1)]
    for trial in trials:
        assert (trial.laps, trial.all_laps, trial.method.syllabus.spare) == (laps.LAPS, True, laps.SHOWN)
        shown = [layout for number in range(1, laps.LAPS + 1) for layout in trial.method.syllabus.proven(5, number)]
        assert len(set(shown)) == laps.LAPS * laps.SHOWN


def test_what_was_passed_after_each_lap_is_counted():
    found = [
        lap("train", 1, human_labels=20, interventions=5),
        *(lap("prove", 1, passed=k < 9, collisions=int(k >= 9)) for k in range(12)),
        lap("train", 2, human_labels=24, interventions=6),
        *(lap("prove", 2) for _ in range(12)),
    ]
    first, second, *rest = laps.rows([outcome("plus", laps=tuple(found))])
    assert (first["human_labels"], first["unseen_passed"], first["unseen_laps"], first["collisions"]) == (20, 9, 12, 3)
    assert (second["interventions"], second["unseen_passed"]) == (6, 12)
    assert second["share_low"] == pytest.approx(0.735, abs=0.001)
    assert rest == []
