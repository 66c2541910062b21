"""Methods at equal quality, from outcomes made up by hand."""

import dataclasses

import msgspec
import pytest
from made_up_outcomes import outcome

from lira.fusion.methods import presets
from lira.fusion.methods.syllabus import Syllabus
from lira.fusion.teaching.teacher import UNSKILLED
from lira.hal.errors import ConfigError
from lira.tools.cli import main
from lira.tools.experiments.effort import equal_quality
from lira.tools.experiments.effort.equal_quality import curve, reached, tail
from lira.tools.experiments.output import document, lead
from lira.tools.experiments.output.fields import SHOWN, lacking
from lira.tools.experiments.output.summary import read_summary, summarise, to_json
from lira.tools.experiments.quality import Judged, Point
from lira.tools.experiments.registry import REGISTRY, load
from lira.tools.experiments.selection import Selection, chosen_methods, own_trials
from lira.tools.experiments.studies import unseen

LEVELS = (0.9, 0.97)


def point(number, labels, passed, *, collisions=0, demonstration=0):
    return Point(
        number, labels, demonstration, labels // 4, 3 * labels, 0.2 * labels, 12, passed, collisions, driven_m=500.0
    )


def judged(levels, passed, *, way="plain", collisions=0):
    return Judged(tuple(levels), way, 12, passed, collisions, 12 - passed - collisions, 0, 600.0)


def run(method, seed, points, *, experts=None, more=()):
    """A trial with these points of (labels, passed); who reached a level passed as many layouts afterwards."""
    curve = tuple(point(k, labels, passed) for k, (labels, passed) in enumerate(points, start=1))
    tried = [
        judged(new, each.passed)
        for k, each in enumerate(curve)
        if (new := [level for level in LEVELS if each.reaches(level) and not any(p.reaches(level) for p in curve[:k])])
    ]
    made = outcome(method, seed, labels=points[-1][0], world=unseen.WORLD)
    trial = msgspec.structs.replace(made.trial, experts=experts)
    return msgspec.structs.replace(made, trial=trial, points=curve, judged=(*tried, *more))


def outcomes():
    ours = [run("plus", seed, [(labels, 12)]) for seed, labels in enumerate((20, 24, 22, 60))]
    theirs = [
        run("hg-dagger", seed, [(labels // 2, 4), (labels, 11 if seed < 3 else 8)])
        for seed, labels in enumerate((60, 72, 66, 180))
    ]
    return ours + theirs


def test_every_method_is_taught_to_the_same_quality_and_shown_other_layouts_afterwards():
    trials = load("unseen").trials(2)
    assert {trial.quality for trial in trials} == {unseen.TO}
    assert {(trial.method.syllabus.proofs, trial.unseen) for trial in trials} == {(12, 12)}
    assert {trial.seed for trial in trials} == {0, 1}
    own = {trial.method.name for trial in trials if trial.method.syllabus.layouts == "own"}
    assert {"hold", "hg-dagger", "lazy-dagger"} <= own
    assert not {"plus", "hg-dagger-kernel", "lazy-dagger-fresh"} & own
    assert chosen_methods(None, load("unseen"), "unseen") == set(unseen.USUAL)


def test_all_with_the_novice_of_plus_are_a_group_and_a_summary_of_their_own():
    asked = Selection(1, methods="kernel")
    names = {trial.method.name for trial in asked.trials(load("unseen"), "unseen")}
    assert names == {"plus"} | {f"{name}-kernel" for name in ("hold", *(method.name for method in presets.RIVALS))}
    assert asked.elsewhere == "-kernel"
    assert chosen_methods("kernel,hg-dagger", load("unseen"), "unseen") == names | {"hg-dagger"}
    with pytest.raises(ConfigError, match="has no method 'nobody'") as refused:
        chosen_methods("kernel,nobody", load("unseen"), "unseen")
    assert "kernel, or all" in refused.value.remedy


@pytest.mark.parametrize(("passed", "levels"), [(10, []), (11, [0.9]), (12, [0.9, 0.97])])
def test_eleven_of_twelve_are_ninety_percent_and_all_are_ninety_seven(passed, levels):
    assert [level for level in LEVELS if point(1, 20, passed).reaches(level)] == levels


def test_who_was_never_asked_reaches_nothing():
    assert not Point(1, 20, 0, 5, 60, 4.0).reaches(0.9)


def test_the_effort_to_a_level_is_that_of_the_first_lap_that_came_to_it_or_all_of_it():
    one = run("plus", 0, [(10, 3), (20, 11), (35, 10), (50, 12)])
    assert [(reached(one, level).human_labels, reached(one, level).converged) for level in LEVELS] == [
        (20, True),
        (50, True),
    ]
    never = run("plus", 0, [(10, 3), (40, 10)])
    assert (reached(never, 0.9).human_labels, reached(never, 0.9).converged) == (40, False)


def test_the_quality_of_a_method_with_its_tails_and_an_interval():
    ours, theirs = unseen.quality(outcomes())
    assert (ours["method"], ours["pair"], ours["quality"], ours["n"], ours["censored"]) == ("plus", "line", 0.9, 4, 0)
    assert (ours["human_labels"], ours["human_labels_90"], ours["human_labels_max"]) == (23, 60, 60)
    assert (ours["unseen_laps"], ours["unseen_passed"], ours["collisions"]) == (48, 48, 0)
    assert ours["share_low"] == pytest.approx(0.926, abs=1e-3)
    assert (theirs["unseen_laps"], theirs["unseen_passed"], theirs["censored"]) == (36, 33, 1)
    assert theirs["lap"] == 2


def test_the_tail_of_few_runs_is_one_of_them():
    assert [tail([1, 2, 3]), tail(list(range(10))), tail([7])] == [3, 8, 7]


def test_pairs_of_experts_are_told_apart():
    played = [run("plus", seed, [(20, 12)], experts=pair) for seed, pair in ((0, None), (0, "line@1"), (1, "line@1"))]
    assert [(row["pair"], row["n"]) for row in unseen.quality(played)] == [("line", 1), ("line@1", 2)]


def test_ratios_are_over_plus_at_one_quality_and_count_who_never_got_there():
    rows = {(row["quantity"], row["quality"]): row for row in unseen.ratios(outcomes())}
    assert rows["human_labels", 0.9] == {
        "method": "plus", "against": "hg-dagger", "quantity": "human_labels", "quality": 0.9,
        "median": 3.0, "low": 3.0, "high": 3.0, "n": 4, "censored": 1,
    }  # fmt: skip
    assert rows["human_labels", 0.97]["censored"] == 4
    assert {quantity for quantity, _ in rows} == {"human_labels", "interventions", "human_labels and demonstration"}


def test_a_curve_says_how_good_novices_were_on_whom_at_most_so_much_was_spent():
    group = [run("plus", 0, [(10, 6), (20, 12)]), run("plus", 1, [(30, 3)])]
    assert curve(group, "human_labels", 5) == (0.0, None)
    assert curve(group, "human_labels", 10) == (0.25, 0.0)
    assert curve(group, "human_labels", 25) == (0.5, 0.0)
    assert curve(group, "human_labels", 30)[0] == pytest.approx(0.625)
    crashed = msgspec.structs.replace(group[0], points=(point(1, 10, 6, collisions=5),))
    assert curve([crashed], "human_labels", 10)[1] == pytest.approx(1.0)


def test_the_ways_of_deployment_stand_side_by_side():
    plain = run("plus", 0, [(20, 11)])
    shielded = msgspec.structs.replace(plain, judged=(*plain.judged, judged([0.9], 12, way="shield")))
    rows = equal_quality.way_rows({"plus": [shielded]}, 0.9)
    assert [(row["deployed"], row["unseen_passed"]) for row in rows] == [("plain", 11), ("shield", 12)]


def test_what_more_teaching_does_is_held_against_what_was_proven():
    taught_on = run("plus", 0, [(20, 12)], more=[judged([], 9)])
    rows = equal_quality.more_rows({"plus": [taught_on]})
    assert [(row["when"], row["unseen_passed"]) for row in rows] == [("proven", 12), ("taught on", 9)]
    later = msgspec.structs.replace(taught_on, points=(*taught_on.points, point(2, 50, 12)))
    rows = equal_quality.more_rows({"plus": [taught_on, later, later]})
    assert [(row["human_labels"], row["human_labels_max"]) for row in rows] == [(20, 20), (50, 50)]
    assert equal_quality.more_rows({"plus": [run("plus", 0, [(20, 12)])]}) == []


def test_a_summary_keeps_quality_and_curves_and_one_without_any_is_as_it_was(tmp_path):
    summary = summarise("unseen", REGISTRY["unseen"].words, "command", 4, load("unseen"), outcomes())
    path = tmp_path / "unseen.json"
    path.write_text(to_json(summary))
    assert read_summary(path).quality == unseen.quality(outcomes())
    assert read_summary(path).curves == unseen.curves(outcomes())
    bare = to_json(msgspec.structs.replace(summary, quality=[], curves=[]))
    assert '"quality": [' not in bare
    assert '"curves"' not in bare


def test_a_proof_of_ones_own_stays_with_what_a_method_is():
    assert unseen.to_quality("plus").syllabus == Syllabus("fresh", 12)
    assert unseen.to_quality("hg-dagger").syllabus == Syllabus("own", 12)


def test_where_by_whom_and_with_whose_experts_can_be_chosen():
    asked = Selection(
        2,
        300,
        "plus",
        pairs=("line@1", "line@2"),
        world="race",
        teacher="unskilled",
        shift="gray",
        randomised=True,
        laps=20,
        more=5,
        ways=("plain", "ask"),
    )
    trials = asked.trials(load("unseen"), "unseen")
    assert len(trials) == 4
    assert {(each.seed, each.experts) for each in trials} == {
        (seed, pair) for seed in (300, 301) for pair in ("line@1", "line@2")
    }
    assert {(each.world, each.skill, each.quality.shift, each.quality.more, each.laps) for each in trials} == {
        ("race", UNSKILLED, "gray", 5, 20)
    }
    assert asked.command == (
        "--seeds 2 --methods plus --first-seed 300 --experts line@1,line@2 --world race --teacher unskilled "
        "--shift gray --randomise --laps 20 --more 5 --ways plain,ask"
    )
    assert all(each.quality.randomised for each in trials)
    assert asked.elsewhere == "-race-unskilled-randomised-gray-more5-ask"
    assert len({each.file for each in trials}) == 4


def test_what_an_experiment_does_not_know_is_refused():
    with pytest.raises(ConfigError, match="takes no --world"):
        Selection(1, world="race").trials(load("table2"), "table2")
    with pytest.raises(ConfigError, match="no way of deployment 'rope'"):
        Selection(1, ways=("rope",)).trials(load("unseen"), "unseen")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"^no shift 'snow'"):
        Selection(1, shift="snow").trials(load("unseen"), "unseen")
    with pytest.raises(ConfigError, match=r"^no teacher 'nobody'\. Teachers"):
        Selection(1, teacher="nobody").trials(load("unseen"), "unseen")


def test_the_cap_of_laps_is_stated_and_no_run_drives_layouts_of_another():
    assert {each.laps for each in load("unseen").trials(1)} == {unseen.LAPS} == {12}
    assert {each.laps for each in Selection(1, laps=6).trials(load("ablation"), "ablation")} == {6}
    most = unseen.to_quality("plus").syllabus.most_laps
    proven = [layout for lap in range(1, most + 1) for layout in unseen.to_quality("plus").syllabus.proven(7, lap)]
    assert not set(proven) & set(unseen.to_quality("plus").syllabus.proven(8, 1))
    assert Selection(1, laps=most - 5, more=5).trials(load("unseen"), "unseen")
    for selection in (Selection(1, laps=most, more=1), Selection(1, more=most)):
        with pytest.raises(ConfigError, match="more are more than there are fresh layouts for"):
            selection.trials(load("unseen"), "unseen")
    with pytest.raises(ConfigError, match=r"table2 takes no --laps\. "):
        Selection(1, laps=6).trials(load("table2"), "table2")


def test_a_method_of_ones_own_is_taught_on_the_layouts_of_plus_and_shown_last(monkeypatch):
    monkeypatch.setattr(
        "lira.tools.experiments.selection.method_named",
        lambda name: presets.Preset(name, presets.OwnSettings(name=name)),
    )
    listed = load("unseen").trials(2)
    trials = own_trials(["lab:Mine"], listed, load("unseen"), "unseen")
    assert [(trial.seed, trial.method.name) for trial in trials] == [(0, "lab:Mine"), (1, "lab:Mine")]
    assert {trial.method.syllabus for trial in trials} == {unseen.to_quality("plus").syllabus}
    played = [run("plus", seed, [(30, 12)]) for seed in range(4)]
    trial = msgspec.structs.replace(played[0].trial, method=trials[0].method)
    mine = [
        msgspec.structs.replace(each, trial=msgspec.structs.replace(trial, seed=each.trial.seed)) for each in played
    ]
    assert [row["method"] for row in unseen.quality([*mine, *outcomes()])] == ["plus", "hg-dagger", "lab:Mine"]
    assert {row["against"] for row in unseen.ratios([*mine, *outcomes()])} == {"hg-dagger", "lab:Mine"}


def summaries(names):
    """Those of `unseen` with these methods, and of the same under a shift."""
    played = [run(name, seed, [(20, 6), (40, 12)]) for name in names for seed in range(3)]
    main = summarise("unseen", "words", "lira experiment unseen", 3, load("unseen"), played)
    parts = summarise("ablation", "words", "lira experiment ablation", 3, load("ablation"), played[:6])
    elsewhere = summarise("unseen-gray", "words", "lira experiment unseen", 3, load("unseen"), played[:12])
    return [main, elsewhere, parts]


def test_results_lead_with_effort_and_quality_side_by_side(tmp_path):
    found = [summarise("unseen", "words", "lira experiment unseen --seeds 4", 4, load("unseen"), outcomes())]
    text = document.documents(found, {})["RESULTS.md"]
    assert "| plus | 4 | 0 | 23, 60, 60 | 5.5, 15, 15 |" in text
    assert "| hg-dagger | 4 | 1 | 69, 180, 180 |" in text
    assert "| 48 of 48 [93, 100] % |" in text
    assert "| 3 [3, 3] |" in text
    assert "| plus | 48 of 48, 0 |" in text
    lead.draw(found, tmp_path)
    assert (tmp_path / lead.PICTURE).read_bytes().startswith(b"<?xml")
    assert f"]({lead.PICTURE})" in text


def test_results_show_all_methods_with_the_novice_of_plus_beside_it():
    main, elsewhere, _ = summaries(["plus"])
    text = document.documents([main, msgspec.structs.replace(elsewhere, name="unseen-kernel")], {})["RESULTS.md"]
    assert "## Rivals with the same novice" in text
    assert "## Elsewhere" not in text


def test_results_stay_short_with_every_method_and_say_when_nothing_was_played():
    thesis = [msgspec.structs.replace(summaries(["plus"])[0], name=name) for name in REGISTRY if name != "unseen"]
    texts = document.documents([*summaries(unseen.NAMES), *thesis], {})
    assert texts["RESULTS.md"].count("\n") <= 150
    assert "[gray](docs/results/unseen.md#unseen-gray)" in texts["RESULTS.md"]
    assert "What each part of plus is worth" in texts["RESULTS.md"]
    assert "has not been played yet" in document.documents(thesis, {})["RESULTS.md"]


def without(summary, name):
    """A summary as of a version that knew nothing of a field."""
    bare = {each: [drop(row, name) for row in getattr(summary, each)] for each in ("results", "ratios", "curves")}
    tables = [dataclasses.replace(each, rows=[drop(row, name) for row in each.rows]) for each in summary.tables]
    return msgspec.structs.replace(summary, tables=tables, **bare)


def drop(row, name):
    return {key: value for key, value in row.items() if key != name}


@pytest.mark.parametrize("name", sorted({name for names in SHOWN.values() for name in names}))
def test_a_summary_of_another_version_is_shown_with_empty_cells_and_says_which(tmp_path, capsys, name):
    taught_on = [run("plus", seed, [(20, 12)], more=[judged([], 9)]) for seed in range(3)]
    more = summarise("unseen-more1", "words", "lira experiment unseen --more 1", 3, load("unseen"), taught_on)
    main_one, gray, _ = summaries(["plus", "hg-dagger"])
    assert not any(map(lacking, (main_one, gray, more)))
    for each in (without(main_one, name), gray, without(more, name)):
        (tmp_path / f"{each.name}.json").write_text(to_json(each))
    out = tmp_path / "out" / "RESULTS.md"
    assert main(["experiment", "results", "--summaries", str(tmp_path), "--out", str(out)]) == 0
    said = capsys.readouterr().err
    file = tmp_path / ("unseen-more1.json" if name == "when" else "unseen.json")
    assert f"{file} is of another version: no {name} in '" in said
    assert "  Play it again: lira experiment unseen " in said
    assert f" --json {file}\n" in said
    assert "unseen-gray.json" not in said
    assert "| [gray](docs/results/unseen.md#unseen-gray) | plus | 3 | 0 | 40, 40, 40 |" in out.read_text()
    assert "None" not in out.read_text()
