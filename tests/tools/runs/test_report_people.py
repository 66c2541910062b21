"""People in a report: reaction times, calls that nobody answered, time at the controls; two runs side by side."""

import dataclasses
from pathlib import Path

import msgspec
import pytest

from lira.fusion.log.run_log import LapRecord, ResultRecord, RunRecord, RunWriter, StepRecord, VerdictRecord
from lira.hal.messages import Decision, LabelCounts, Phase
from lira.tools.cli import main
from lira.tools.report import write_comparison, write_report
from lira.tools.report.answers import answer_cells, answers
from lira.tools.report.digest import Lap, digest

CALM = Decision(0.0, 0, "novice", "none", (1.0, 0.0), (1.0, 0.0), None, (), 0.06, LabelCounts(), 1, 0, 0)
HEAD = RunRecord("line", "thesis-sim", "plus", "plus", 0, 0, "lira teach", "0")


def lap(words):
    """A lap of a step for each letter: n novice, c it calls, h human, w it waits for a demonstration."""
    kinds = {"n": ("novice", "none"), "c": ("novice", "feedback"), "h": ("human", "none"), "w": ("none", "feedback")}
    steps = [
        StepRecord(dataclasses.replace(CALM, stamp_s=0.2 * k, driver=kinds[each][0], call=kinds[each][1]))
        for k, each in enumerate(words)
    ]
    return Lap(Phase.TRAIN, 1, 0, tuple(steps))


@pytest.mark.parametrize(
    ("words", "reactions", "missed"),
    [
        ("nnnn", [], 0),
        ("ncchhn", [0.4], 0),
        ("ncnnh", [0.6], 0),
        ("nc" + "n" * 12 + "h", [], 1),
        ("ncc", [], 1),
        ("wwwhhh", [], 0),
        ("chnnch", [0.2, 0.2], 0),
    ],
)
def test_a_call_is_answered_by_the_dead_man_or_missed(words, reactions, missed):
    found = answers(lap(words))
    assert found.reactions_s == pytest.approx(tuple(reactions))
    assert found.missed == missed


def test_time_at_the_controls_is_that_of_the_steps_and_not_of_gaps():
    steps = list(lap("nhhn").steps)
    assert answers(lap("nhhn")).human_s == pytest.approx(0.4)
    late = dataclasses.replace(steps[-1].decision, stamp_s=60.0)
    gap = dataclasses.replace(lap("nhhn"), steps=(*steps[:-1], msgspec.structs.replace(steps[-1], decision=late)))
    assert answers(gap).human_s == pytest.approx(0.2)
    assert answer_cells(lap("nhhn"))[1:3] == ["0.4 s", "67%"]


def written(folder: Path, words, person):
    with RunWriter(folder / "run.jsonl") as record:
        record.write(HEAD)
        for step in lap(words).steps:
            record.write(step)
        record.write(VerdictRecord(person, "It drove 2 of 3 unseen layouts", True))
    return folder


def test_a_session_has_its_verdict_its_person_and_a_style_for_paper(tmp_path):
    page = write_report(written(tmp_path / "a", "ncchhn", "ada")).read_text()
    assert "It drove 2 of 3 unseen layouts" in page
    assert ">ada<" in page
    assert "What it asked of the person" in page
    assert "@media print" in page


def test_a_run_that_went_on_another_day_shows_all_its_days():
    result = ResultRecord(False, 1, 4, 0, 1, 2, 9, 3, simulated_s=60.0, elapsed_s=50.0)
    first, second = lap("nhhn").steps, lap("ncch").steps
    run = digest([HEAD, *first, result, VerdictRecord("ada", "It did not", False), HEAD, *second])
    assert [each.title for each in run.laps] == ["Day 1: training lap 0", "Day 2: training lap 0"]
    assert [len(each.steps) for each in run.laps] == [4, 4]
    assert (run.result, run.verdict) == (None, None)  # the second day was cut off
    run = digest([HEAD, *first, result, HEAD, *second, msgspec.structs.replace(result, human_labels=7)])
    assert (run.result.human_labels, run.result.simulated_s, run.result.elapsed_s) == (7, 120.0, 100.0)
    assert digest([HEAD, *first]).laps[0].title == "Training lap 0"


def test_a_lap_that_was_cut_off_at_once_is_none():
    steps = lap("nnnn").steps
    later = [msgspec.structs.replace(s, decision=dataclasses.replace(s.decision, lap=2)) for s in lap("n" * 20).steps]
    record = LapRecord(Phase.TRAIN, 0, 0, True, True, 0.8, 0, 0, None, 1, 1, 1, 1, 1, 1.0)
    assert [len(each.steps) for each in digest([HEAD, *steps, record, *later[:3]]).laps] == [4]
    assert [len(each.steps) for each in digest([HEAD, *steps, record, *later]).laps] == [4, 20]


def test_two_runs_are_shown_side_by_side(tmp_path, capsys):
    folders = written(tmp_path / "a", "ncchhn", "ada"), written(tmp_path / "b", "nnnnnn", "bob")
    page = write_comparison(folders, tmp_path / "both.html").read_text()
    assert "<td>ada</td><td>bob</td>" in page
    assert main(["report", str(folders[0]), str(folders[1])]) == 0
    assert (folders[0] / "comparison.html").is_file()
    assert main(["report", "a", "b", "c"]) == 2
    capsys.readouterr()
