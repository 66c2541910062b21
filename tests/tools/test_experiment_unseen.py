"""Methods at equal quality, from outcomes made up by hand."""

import msgspec
import pytest
from made_up_outcomes import lap, outcome

from lira.fusion.methods import presets
from lira.fusion.methods.syllabus import Syllabus
from lira.tools.experiments.registry import REGISTRY, load
from lira.tools.experiments.studies import unseen
from lira.tools.experiments.summary import read_summary, summarise, to_json
from lira.tools.verbs.experiment import chosen_methods, own_trials


def run(method, seed, *, labels=20, passed=12, converged=True, collisions=0, experts=None):
    shown = [lap("unseen", k, passed=k < passed, collisions=collisions if k == passed else 0) for k in range(12)]
    laps = (lap(), *shown)
    made = outcome(
        method, seed, labels=labels, interventions=labels // 4, converged=converged, world=unseen.WORLD, laps=laps
    )
    trial = msgspec.structs.replace(made.trial, experts=experts)
    return msgspec.structs.replace(made, trial=trial)


def outcomes():
    ours = [run("plus", seed, labels=labels) for seed, labels in enumerate((20, 24, 22, 60))]
    theirs = [
        run("hg-dagger", seed, labels=labels, passed=9, collisions=2, converged=seed < 3)
        for seed, labels in enumerate((60, 72, 66, 180))
    ]
    return ours + theirs


def test_every_method_is_taught_until_it_passes_the_same_proof_and_shown_other_layouts_afterwards():
    trials = load("unseen").trials(2)
    assert {trial.method.syllabus.proof for trial in trials} == {"fresh:11/12"}
    assert {trial.unseen for trial in trials} == {12}
    assert {trial.seed for trial in trials} == {0, 1}
    own = {trial.method.name for trial in trials if trial.method.syllabus.layouts == "own"}
    assert {"hold", "hg-dagger"} <= own
    assert not {"plus", "hg-dagger-kernel"} & own
    assert chosen_methods(None, load("unseen"), "unseen") == set(unseen.USUAL)


def test_the_quality_of_a_method_with_its_tails_and_an_interval():
    ours, theirs = unseen.quality(outcomes())
    assert (ours["method"], ours["pair"], ours["n"], ours["censored"]) == ("plus", "line", 4, 0)
    assert (ours["human_labels"], ours["human_labels_90"], ours["human_labels_max"]) == (23, 60, 60)
    assert (ours["unseen_laps"], ours["unseen_passed"], ours["collisions"]) == (48, 48, 0)
    assert ours["share_low"] == pytest.approx(0.926, abs=1e-3)
    assert (theirs["unseen_passed"], theirs["collisions"], theirs["censored"]) == (36, 8, 1)


def test_pairs_of_experts_are_told_apart():
    rows = unseen.quality([run("plus", 0), run("plus", 0, experts="line@1"), run("plus", 1, experts="line@1")])
    assert [(row["pair"], row["n"]) for row in rows] == [("line", 1), ("line@1", 2)]


def test_ratios_are_over_plus_at_one_quality_and_count_who_never_got_there():
    rows = {row["quantity"]: row for row in unseen.ratios(outcomes())}
    assert rows["human_labels"] == {
        "method": "plus", "against": "hg-dagger", "quantity": "human_labels", "quality": 0.9,
        "median": 3.0, "low": 3.0, "high": 3.0, "n": 4, "censored": 1,
    }  # fmt: skip
    assert set(rows) == {"human_labels", "interventions", "human_labels and demonstration"}


def test_a_summary_keeps_the_quality_and_one_without_any_is_as_it_was(tmp_path):
    summary = summarise("unseen", REGISTRY["unseen"].words, "command", 4, load("unseen"), outcomes())
    path = tmp_path / "unseen.json"
    path.write_text(to_json(summary))
    assert read_summary(path).quality == unseen.quality(outcomes())
    assert '"quality": [' not in to_json(msgspec.structs.replace(summary, quality=[]))


def test_a_proof_of_ones_own_stays_with_what_a_method_is():
    method = unseen.to_quality("plus")
    assert method.syllabus == Syllabus("fresh", 12, 1)
    assert unseen.to_quality("hg-dagger").syllabus == Syllabus("own", 12, 1)


def test_a_method_of_ones_own_is_taught_on_the_layouts_of_plus_and_shown_last(monkeypatch):
    monkeypatch.setattr(presets, "method_named", lambda name: presets.Preset(name, presets.OwnSettings(name=name)))
    listed = load("unseen").trials(2)
    trials = own_trials(["lab:Mine"], listed, load("unseen"), "unseen")
    assert [(trial.seed, trial.method.name) for trial in trials] == [(0, "lab:Mine"), (1, "lab:Mine")]
    assert {trial.method.syllabus for trial in trials} == {unseen.to_quality("plus").syllabus}
    played = [run("plus", seed, labels=30) for seed in range(4)]
    trial = msgspec.structs.replace(played[0].trial, method=trials[0].method)
    mine = [
        msgspec.structs.replace(each, trial=msgspec.structs.replace(trial, seed=each.trial.seed)) for each in played
    ]
    assert [row["method"] for row in unseen.quality([*mine, *outcomes()])] == ["plus", "hg-dagger", "lab:Mine"]
    assert {row["against"] for row in unseen.ratios([*mine, *outcomes()])} == {"hg-dagger", "lab:Mine"}
