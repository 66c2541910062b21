"""Tables, findings and pages from outcomes made up by hand: every expected number is worked out here."""

import json
import re

import msgspec
import pytest
from made_up_outcomes import HOLD, lap, outcome

from lira.fusion.log.counts import Account
from lira.hal.errors import StorageError
from lira.tools.cli import main
from lira.tools.experiments import methods
from lira.tools.experiments.effort.measures import driving_row, effort_row, label_row, source_rows
from lira.tools.experiments.experiment import Finding, Picture
from lira.tools.experiments.output import document
from lira.tools.experiments.output.page import write_page
from lira.tools.experiments.output.summary import read_summaries, read_summary, summarise, to_json
from lira.tools.experiments.registry import REGISTRY, load
from lira.tools.experiments.selection import chosen_methods
from lira.tools.experiments.studies import compare, densities, faults, sharing, thresholds, trajectories
from lira.tools.experiments.trial import Trial


def test_labels_of_a_group_in_the_columns_of_table_2():
    group = [outcome(HOLD, seed, labels=labels) for seed, labels in enumerate((10, 20, 60, 40))]
    row = label_row([*group, outcome(HOLD, 4, labels=500, converged=False)])
    assert (row["n"], row["censored"]) == (5, 1)
    assert (row["human_labels"], row["human_labels_mean"], row["human_labels_iqm"]) == (40, 126, 40)
    assert (row["buffer_first"], row["buffer"]) == (50, 90)


def test_precision_and_recall_are_over_the_whole_group():
    accounts = [Account(call_episodes=4, answered=1, called_for=1), Account(call_episodes=6, answered=4, called_for=3)]
    group = [outcome(HOLD, seed, interventions=4, account=each) for seed, each in enumerate(accounts)]
    row = effort_row(group)
    assert (row["precision"], row["recall"]) == (5 / 10, 4 / 8)
    silent = effort_row([outcome("hg-dagger")])
    assert (silent["precision"], silent["recall"]) == (None, None)


def test_the_humans_time_is_steps_at_five_hertz_and_the_experts_labels_are_those_of_their_files():
    row = effort_row([outcome(HOLD)])
    assert row["human_time_s"] == pytest.approx(10.0)
    assert row["human_total"] == 70
    assert row["with_experts"] > row["human_total"]


def test_labels_are_counted_by_source():
    accounts = [Account(given={"human": 10, "mean": 4}, stored={"human": 9, "mean": 1}), Account(given={"human": 20})]
    rows = source_rows([outcome(HOLD, seed, account=each) for seed, each in enumerate(accounts)])
    assert rows == [
        {"method": HOLD, "source": "human", "given": 15.0, "stored": 4.5},
        {"method": HOLD, "source": "mean", "given": 2.0, "stored": 0.5},
    ]


def test_only_laps_driven_to_the_end_have_a_time_to_finish():
    unseen = [
        lap("unseen", 1, duration_s=50.0),
        lap("unseen", 2, duration_s=90.0, passed=False, collisions=2, lateral_rms_m=0.5),
        lap("unseen", 3, duration_s=60.0, lateral_rms_m=None),
    ]
    row = driving_row([outcome(HOLD, laps=(lap(collisions=3), *unseen))])
    assert (row["training_collisions"], row["unseen_collisions"]) == (3, 2)
    assert (row["unseen_passed"], row["unseen_laps"]) == (2, 3)
    assert (row["time_to_finish_s"], row["lateral_rms_m"]) == (55.0, 0.375)


def compared(theirs, *, converged=True):
    found = []
    for seed in range(4):
        found += [outcome(method.name, seed, labels=20, interventions=10) for method in compare.LIRA]
        found += [
            outcome(method.name, seed, labels=20 * theirs, interventions=10 * theirs, converged=converged)
            for method in compare.HG_DAGGER
        ]
    return found


def test_ratios_have_the_columns_that_are_promised():
    rows = compare.ratios(compared(3, converged=False))
    assert len(rows) == len(compare.LIRA) * len(compare.HG_DAGGER) * 2
    assert rows[0] == {
        "method": HOLD, "against": "hg-dagger", "quantity": "human_labels",
        "median": 3.0, "low": 3.0, "high": 3.0, "n": 4, "censored": 4,
    }  # fmt: skip


@pytest.mark.parametrize(("theirs", "fewer"), [(3, True), (1, False)])
def test_a_comparison_agrees_where_the_whole_interval_is_above_one(theirs, fewer):
    found = {finding.key: finding for finding in compare.findings(compared(theirs), "race")}
    assert found[f"race.{HOLD}.human_labels.fewer"].agrees is fewer
    assert found[f"race.{HOLD}.human_labels.size"].agrees is False  # neither is 2.65
    assert len({finding.key for finding in found.values()}) == len(found)


def test_experts_are_paid_back_by_what_each_task_saves():
    row = compare.amortised(compared(3))[0]
    assert row["saved_per_task"] == 40
    assert row["tasks_until_paid"] == pytest.approx(row["experts_labels"] / 40)
    assert compare.amortised(compared(1))[0]["tasks_until_paid"] is None


@pytest.mark.parametrize(("ours", "agrees"), [([90, 20, 5, 4], True), ([90, 20, 5, 5], True), ([90, 20, 25, 4], False)])
def test_an_order_may_hold_ties_but_no_exchange(ours, agrees):
    assert thresholds.in_order(ours, [998, 124, 40, 30]) is agrees


def test_the_buffer_of_table_c1_has_to_fall_by_five():
    found = {}
    for second in (100, 300):
        outcomes = []
        for (theta, keep), buffer in zip(thresholds.THESIS_C1, (1000, second, 30, 30), strict=True):
            for preset, experts in thresholds.PLAYED:
                method = thresholds.method(preset, theta, keep)
                made = outcome(HOLD, laps=(lap(buffer=buffer // 2), lap(number=2, buffer=buffer)))
                outcomes.append(msgspec.structs.replace(made, trial=Trial(method, "eight", 0, experts=experts)))
        found[second] = {finding.key: finding for finding in thresholds.findings(outcomes, "tableC1")}
    assert found[100]["tableC1.thesis.eight.fall"].agrees
    assert not found[300]["tableC1.thesis.eight.fall"].agrees
    assert found[300]["tableC1.thesis.eight.order"].agrees


def race():
    return [outcome(method.name, seed) for method in methods.DRAWN for seed in range(2)]


def test_labels_are_sorted_by_source_and_by_kind():
    rows = {(row["method"], row["source"]): row for row in densities.rows(race())}
    human, experts = rows[HOLD, "human"], rows[HOLD, "experts"]
    assert (human["labels_per_run"], human["straight"], human["full_turn"]) == (2, 0.5, 0.5)
    assert (experts["mid_range_turn"], experts["full_speed"]) == (1.0, 1.0)
    found = {finding.key: finding.agrees for finding in densities.findings(race())}
    assert found[f"labels.{HOLD}.mid_range"]
    assert found[f"labels.{HOLD}.share"]
    assert not found["labels.hg-dagger.backward"]


def test_densities_that_are_equal_have_no_distance_and_disjoint_ones_have_all():
    left, right = [(1.0, -1.0)] * 3, [(1.0, 1.0)] * 5
    assert densities.distance(left, left, 1) == 0.0
    assert densities.distance(left, right, 1) == 1.0
    assert densities.distance(left, right, 0) == 0.0


def test_what_a_fault_costs_is_paired_with_the_perfect_teacher():
    outcomes = [
        outcome(method.name, seed, labels=labels, teacher=teacher, skill=faults.SKILLS[teacher])
        for teacher, labels in (("perfect", 10), ("unskilled", 25))
        for method in faults.METHODS
        for seed in range(3)
    ]
    rows = faults.cost(outcomes)
    assert [(row["teacher"], row["median"]) for row in rows] == [("unskilled", 2.5)] * 2
    assert all(finding.agrees for finding in faults.findings(outcomes))
    for fault, names in faults.FAULTS.items():
        changed = [name for name, value in msgspec.structs.asdict(faults.alone(fault)).items()
                   if value != getattr(faults.PERFECT, name)]  # fmt: skip
        assert sorted(changed) == sorted(names)


def test_table_d1_sets_fixed_over_flexible():
    taken = {"hold": (40, 8), "hold-fixed": (30, 20), "hold-flexible": (60, 10)}
    outcomes = [
        outcome(name.replace("hold", preset), seed, labels=labels, interventions=interventions)
        for preset in sharing.PRESETS
        for name, (labels, interventions) in taken.items()
        for seed in range(3)
    ]
    medians = {(row["method"], row["quantity"]): row["median"] for row in sharing.ratios(outcomes)}
    assert medians["hold-flexible", "human_labels"] == 0.5
    assert medians["thesis-flexible", "interventions"] == 2.0
    found = {finding.key: finding.agrees for finding in sharing.findings(outcomes)}
    assert found["tableD1.hold-flexible.human_labels"]
    assert found["tableD1.hold-flexible.interventions"]
    assert not found["tableD1.hold-flexible.buffer"]  # both 90: on no side of 1


def test_every_experiment_in_the_registry_can_be_loaded_and_lists_trials_for_its_seeds():
    for name in REGISTRY:
        trials = load(name).trials(2)
        assert {trial.seed for trial in trials} <= {0, 1}, name
        assert len({trial.file for trial in trials}) == len(set(trials)), name


EXPERIMENTS = {"race": lambda: compared(3), "labels": race, "trajectories": race}


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_a_page_holds_tables_verdicts_and_drawings_and_needs_nothing_else(tmp_path, name):
    outcomes = EXPERIMENTS[name]()
    experiment = load(name)
    summary = summarise(name, REGISTRY[name].words, "command", 4, experiment, outcomes)
    pictures = experiment.figures(outcomes)
    page = write_page(tmp_path, summary, pictures).read_text()
    assert page.count("<table>") == len(summary.tables) + 1
    assert page.count("data:image/svg+xml") == len(pictures) > 0
    assert not re.search(r'(src|href)="(?!data:)', page)
    for picture in pictures:
        assert (tmp_path / f"{name}-{picture.name}.png").read_bytes().startswith(b"\x89PNG")
        assert b"<svg" in (tmp_path / f"{name}-{picture.name}.svg").read_bytes()


def test_a_place_where_no_page_can_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    summary = summarise("race", "words", "command", 4, load("race"), compared(3))
    no_pictures: list[Picture] = []
    with pytest.raises(StorageError, match="cannot write into"):
        write_page(tmp_path / "file", summary, no_pictures)


def test_a_summary_survives_its_file(tmp_path):
    summary = summarise("race", "words", "command", 4, load("race"), compared(3))
    path = tmp_path / "race.json"
    path.write_text(to_json(summary))
    assert read_summary(path) == summary
    kept = json.loads(path.read_text())
    assert kept["results"] == kept["tables"][0]["rows"]
    assert set(kept["ratios"][0]) == {"method", "against", "quantity", "median", "low", "high", "n", "censored"}
    path.write_text("{}")
    with pytest.raises(StorageError, match="not the summary"):
        read_summary(path)


def test_the_nearest_cause_explains_a_finding():
    causes = {"table2": "far", "table2.lira-hold": "near", "table2.lira-hold.human_labels.size": "own"}
    assert document.cause("table2.lira-hold.human_labels.size", causes) == "own"
    assert document.cause("table2.lira-hold.interventions.size", causes) == "near"
    assert document.cause("table2.lira-thesis.x", causes) == "far"
    assert document.cause("race.lira-hold", causes) is None


def test_a_verdict_gives_a_cause_only_where_it_differs():
    agreed = Finding("a.b", "claim", "1", "1.1", True)
    assert document.verdict(agreed, {"a": "because"}) == "- claim. Thesis 1; ours 1.1: **agrees**."
    differs = Finding("a.b", "claim", "1", "9", False)
    assert document.verdict(differs, {"a": "because"}) == "- claim. Thesis 1; ours 9: **differs**. because"
    assert document.verdict(differs, {}).endswith("**differs**. Cause not known.")


def test_results_are_written_from_the_summaries_that_are_there(tmp_path, capsys):
    out = tmp_path / "RESULTS.md"
    where = ["--summaries", str(tmp_path), "--out", str(out)]
    assert main(["experiment", "results", *where]) == 2
    assert "holds no summary" in capsys.readouterr().err
    summary = summarise("race", "words", "command", 4, load("race"), compared(3))
    (tmp_path / "race.json").write_text(to_json(msgspec.structs.replace(summary, commit="abc1234")))
    assert main(["experiment", "results", *where]) == 0
    half = 2 * len(compare.LIRA)  # fewer labels and fewer interventions agree, how many fewer does not
    assert f"| [race](docs/results/race.md) | words | 4 | abc1234 | {half} | {half} |" in out.read_text()
    assert (
        f"| [race](race.md) | words | 4 | abc1234 | {half} | {half} |"
        in (tmp_path / document.PAGES / "index.md").read_text()
    )
    text = (tmp_path / document.PAGES / "race.md").read_text()
    assert f"| {HOLD} | hg-dagger | human_labels | 3 | 3 | 3 | 4 | 0 |" in text
    assert text.count("**agrees**") == half


def test_the_documents_in_the_repository_are_those_of_the_summaries_in_it():
    summaries = read_summaries(document.SUMMARIES, list(REGISTRY))
    for path, text in document.documents(summaries, document.read_causes()).items():
        assert (document.DOCUMENT.parent / path).read_text() == text, f"{path}: run lira experiment results"


def test_every_cause_of_the_project_explains_an_experiment():
    assert {key.split(".")[0] for key in document.read_causes()} <= set(REGISTRY)


def test_final_drives_are_the_last_proving_runs():
    track = trajectories.final(outcome(HOLD))
    assert (track.phase, track.lap) == ("prove", 2)
    row = trajectories.rows(race())[0]
    assert (row["passed"], row["n"], row["mean_speed_m_s"]) == (2, 2, 0.5)


def test_some_methods_may_be_played_alone(capsys, tmp_path):
    alone = [each for each in compared(3) if each.trial.method.name == HOLD]
    race = load("race")
    assert race.ratios(alone) == []
    assert [len(table.rows) for table in race.tables(alone)] == [1, 1, 1, 1]
    assert [picture.name for picture in race.figures(alone)] == ["human_labels", "interventions"]
    where = ["--run", str(tmp_path), "--methods", f"{HOLD},hg"]
    assert main(["experiment", "race", *where]) == 2
    assert "race has no method 'hg'" in capsys.readouterr().err
    assert chosen_methods(None, race, "race") == {"hold", "plus", "hg-dagger", "hg-dagger-warm-m10"}
    assert chosen_methods("all", race, "race") > {"thesis", "cloning", "switching"}
    assert main(["experiment", "ablation", "--run", str(tmp_path), "--experts", "line@1"]) == 2
    assert "ablation takes no --experts" in capsys.readouterr().err
    for name in ("tableC1", "all"):
        assert main(["experiment", name, *where]) == 2
        assert f"{name} takes no --methods" in capsys.readouterr().err
