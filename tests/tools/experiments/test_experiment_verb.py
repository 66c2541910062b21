"""The command from end to end on a short world: trials are played, and tables, page, JSON and RESULTS.md come out."""

import json
from dataclasses import replace

import pytest
from made_up_outcomes import HOLD
from short_trials import short_trial, write_world

from lira.tools.cli import main
from lira.tools.experiments.registry import REGISTRY, load
from lira.tools.verbs.learn import experiment as verb


@pytest.fixture
def short_race(monkeypatch, tmp_path):
    """`race` on a world of eight metres, and no other experiment."""
    world = write_world(tmp_path)

    def trials(seeds):
        return [
            trial
            for seed in range(seeds)
            for trial in (short_trial(world, seed=seed, name=HOLD),
                          short_trial(world, seed=seed, name="hg-dagger", lira=None))
        ]  # fmt: skip

    short = replace(load("race"), trials=trials)
    monkeypatch.setattr(verb, "REGISTRY", {"race": REGISTRY["race"]})
    monkeypatch.setattr(verb, "load", lambda _: short)
    return ["--seeds", "1", "--run", str(tmp_path / "run")]


def test_one_experiment_prints_its_tables_and_keeps_a_page(short_race, tmp_path, capsys):
    assert main(["experiment", "race", *short_race, "--json", str(tmp_path / "race.json")]) == 0
    said = capsys.readouterr()
    assert "[2/2] short hg-dagger perfect seed 0: " in said.err
    assert "HG-DAgger over LIRA-SPF, by pairs of one seed" in said.out
    assert (tmp_path / "run" / "race.html").read_text().count("<table>") > 3
    report = json.loads((tmp_path / "race.json").read_text())
    assert [row["method"] for row in report["results"]] == [HOLD, "hg-dagger"]
    assert [row["n"] for row in report["ratios"]] == [1, 1]

    second = tmp_path / "alone.json"
    assert main(["experiment", "race", *short_race, "--json", str(second), "--methods", HOLD]) == 0
    assert capsys.readouterr().err == ""  # kept trials are not played again
    alone = json.loads(second.read_text())
    assert alone["results"] == report["results"][:1]
    assert alone["command"] == f"lira experiment race --seeds 1 --methods {HOLD}"


def test_all_experiments_end_in_results(short_race, tmp_path):
    out = tmp_path / "RESULTS.md"
    where = ["--summaries", str(tmp_path / "summaries"), "--out", str(out)]
    assert main(["experiment", "all", *short_race, *where]) == 0
    text = (tmp_path / "docs" / "results" / "race.md").read_text()
    assert "`lira experiment race --seeds 1 --methods all`: 2 trials." in text
    assert [path.name for path in (tmp_path / "summaries").iterdir()] == ["race.json"]
    lead = out.read_text()
    out.unlink()
    assert main(["experiment", "results", *where]) == 0
    assert out.read_text() == lead


def test_unseen_layouts_are_asked_for_in_any_world(tmp_path, capsys):
    world, out = write_world(tmp_path), tmp_path / "F.json"
    asked = ["--seeds", "1", "--first-seed", "230", "--methods", "plus", "--ways", "plain", "--world", world]
    assert main(["experiment", "unseen", *asked, "--run", str(tmp_path / "run"), "--json", str(out)]) == 0
    assert "Effort to 90% of fresh layouts" in capsys.readouterr().out
    report = json.loads(out.read_text())
    assert report["name"] == "unseen-short"
    row = report["quality"][0]
    assert {"method", "pair", "n", "human_labels", "interventions", "unseen_laps", "unseen_passed"} <= set(row)
    assert {"collisions", "censored", "human_labels_90", "human_labels_max"} <= set(row)
    assert (row["method"], row["pair"], row["n"], row["unseen_laps"]) == ("plus", "line", 1, 12)
    assert (tmp_path / "run" / "unseen-short.html").exists()
