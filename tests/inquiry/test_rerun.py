"""A recorded run, gone through again: the same to the bit, or where it parts; and what would have been otherwise."""

import json
from dataclasses import replace

import msgspec
import pytest
from recorded_run import write_reports

from lira.fusion.methods.presets import method_named
from lira.hal.errors import ConfigError, StorageError
from lira.hal.messages import CallName, Decision, MethodCalls
from lira.tools.cli import main
from lira.tools.inquiry.otherwise import compare
from lira.tools.inquiry.rerun import go_again
from lira.tools.inquiry.settings import changed, with_setting
from lira.tools.inquiry.trace import read_traces, steps_of
from lira.tools.recording.reader import Recording


def trace_of(folder):
    (trace,) = read_traces(Recording(folder))
    return trace


def spoilt(reports, name, **change):
    """The same reports, with another text in the last call of a kind."""
    number = max(n for n, r in enumerate(reports) if isinstance(r, MethodCalls) and name in [c.name for c in r.calls])
    calls = tuple(replace(call, **change) if call.name is name else call for call in reports[number].calls)
    return [*reports[:number], replace(reports[number], calls=calls), *reports[number + 1 :]]


def test_what_was_taught_comes_out_the_same_to_the_bit(run, tmp_path):
    profile, reports = run
    again = go_again(trace_of(write_reports(tmp_path / "rec", profile, reports)), profile)
    assert again.identical
    assert len(again.proposed) == sum(isinstance(report, Decision) for report in reports)
    assert again.final.labels > 5
    assert again.final.steps > 0
    assert again.final.weights


def test_a_human_who_did_something_else_is_where_it_parts(plus, tmp_path):
    profile, reports = plus
    folder = write_reports(tmp_path / "rec", profile, spoilt(reports, CallName.LEARN, action=(0.5, -0.25)))
    again = go_again(trace_of(folder), profile)
    assert not again.identical
    assert again.differences[0].name == CallName.LEARN
    assert "HUMAN" in str(again.differences[0].now)


def test_weights_that_are_others_are_noticed(plus, tmp_path):
    profile, reports = plus
    other = '{"labels":1,"steps":1,"weights":"00"}'
    folder = write_reports(tmp_path / "rec", profile, spoilt(reports, CallName.END, outcome=other))
    again = go_again(trace_of(folder), profile)
    assert [each.name for each in again.differences] == [CallName.END]


def test_what_was_not_recorded_is_said(plus, tmp_path, capsys):
    profile, reports = plus
    lost = [n for n, report in enumerate(reports) if isinstance(report, MethodCalls)][10]
    folder = write_reports(tmp_path / "rec", profile, reports, skip={lost})
    assert trace_of(folder).missing == 1
    assert main(["rerun", str(folder)]) == 1
    assert "not recorded: 1 message of its calls" in capsys.readouterr().out


def test_the_verb_says_identical_and_tells_it_to_a_machine(plus, tmp_path, capsys):
    profile, reports = plus
    folder = write_reports(tmp_path / "rec", profile, reports)
    assert main(["rerun", str(folder), "--json", str(tmp_path / "out.json")]) == 0
    assert capsys.readouterr().out.startswith("identical: ")
    (found,) = json.loads((tmp_path / "out.json").read_text())
    assert found["identical"] is True
    assert found["final"]["labels"] > 0


def test_other_settings_give_a_table_and_a_page(plus, tmp_path, capsys):
    profile, reports = plus
    folder = write_reports(tmp_path / "rec", profile, reports)
    words = ["rerun", str(folder), "--set", "theta=0.3", "--set", "hold=null", "--page", str(tmp_path / "page.html")]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "'plus' as recorded, and with theta=0.3, hold=null" in out
    assert "calls for attention" in out
    page = (tmp_path / "page.html").read_text()
    assert page.startswith("<!doctype html>")
    assert "theta=0.3" in page


def test_with_a_threshold_that_nobody_reaches_nobody_is_called(plus, tmp_path):
    profile, reports = plus
    trace = trace_of(write_reports(tmp_path / "rec", profile, reports))
    recipe = changed(trace.recipe, None, ["theta=5.0", "hold=null", "prefill=0"])
    rows = {row.name: row for row in compare(go_again(trace, profile, recipe)).rows}
    assert rows["calls for attention"].was > 0
    assert rows["calls for attention"].now == rows["calls for feedback"].now == 0
    assert "labels given: lidar" not in rows


def test_the_recorded_side_counts_as_the_ledger_does(plus, tmp_path):
    profile, reports = plus
    trace = trace_of(write_reports(tmp_path / "rec", profile, reports))
    rows = {row.name: row for row in compare(go_again(trace, profile, changed(trace.recipe, "plus", []))).rows}
    newest = [report for report in reports if isinstance(report, Decision) and report.phase == "train"][-1]
    assert rows["calls for attention"].was + rows["calls for feedback"].was == newest.calls
    assert all(row.was == row.now for row in rows.values())


def test_every_decision_is_a_step(plus, tmp_path):
    profile, reports = plus
    trace = trace_of(write_reports(tmp_path / "rec", profile, reports))
    steps = [step for step in steps_of(trace.calls) if step.learned is not None]
    decisions = [report for report in reports if isinstance(report, Decision)]
    assert [(s.time_s, s.phase, s.learned.choice.driver) for s in steps] == [
        (pytest.approx(d.stamp_s), d.phase, d.driver) for d in decisions
    ]


# What cannot be.


def test_a_recording_from_the_middle_and_one_without_a_learner_are_refused(plus, tmp_path):
    profile, reports = plus
    calls = [report for report in reports if isinstance(report, MethodCalls)]
    with pytest.raises(StorageError, match="begins in the middle"):
        trace_of(write_reports(tmp_path / "middle", profile, calls[3:]))
    with pytest.raises(StorageError, match="nobody learns"):
        trace_of(write_reports(tmp_path / "none", profile, []))


def test_a_method_that_was_an_object_of_a_program_is_named_as_what_is_missing(plus, tmp_path):
    profile, reports = plus
    trace = trace_of(write_reports(tmp_path / "rec", profile, reports))
    trace.recipe = msgspec.structs.replace(trace.recipe, missing="an expert is an object")
    with pytest.raises(ConfigError, match="an expert is an object"):
        go_again(trace, profile)


@pytest.mark.parametrize(
    ("change", "words"),
    [("theta", "no NAME=VALUE"), ("nothing=1", "has no setting"), ("theta=high", "cannot be"), ("noise.x=1", "has no")],
)
def test_a_setting_that_cannot_be_is_refused(change, words):
    with pytest.raises(ConfigError, match=words):
        with_setting(method_named("plus"), change)


def test_a_setting_is_found_by_its_name_wherever_it_stands():
    preset = with_setting(with_setting(method_named("plus"), "theta=0.06"), "learning.human_weight=2.0")
    assert preset.approach.lira.theta == 0.06
    assert preset.learning.human_weight == 2.0
