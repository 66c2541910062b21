"""The labels behind an action are those that were given, at their times."""

import pytest
from recorded_run import write_reports

from lira.hal.messages import Phase
from lira.tools.cli import main
from lira.tools.inquiry.behind import label_times, labels_behind
from lira.tools.inquiry.rerun import go_again
from lira.tools.inquiry.trace import read_traces, steps_of
from lira.tools.recording.reader import Recording


@pytest.fixture(scope="module")
def recorded(plus, tmp_path_factory):
    profile, reports = plus
    folder = write_reports(tmp_path_factory.mktemp("run") / "rec", profile, reports)
    (trace,) = read_traces(Recording(folder))
    return folder, trace, profile


def test_every_label_that_was_learned_has_its_time(recorded):
    _, trace, profile = recorded
    assert len(label_times(trace.calls)) == go_again(trace, profile).final.labels


def test_each_part_is_a_label_that_somebody_gave_then(recorded):
    _, trace, profile = recorded
    steps = [step for step in steps_of(trace.calls) if step.phase == Phase.TRAIN and step.learned is not None]
    found = labels_behind(trace, profile, steps[-1].number)
    assert found
    by_time = {step.time_s: step.learned.choice for step in steps}
    for each in found:
        assert each.time_s < steps[-1].time_s
        assert by_time[each.time_s].label == pytest.approx(each.part.action)
        assert by_time[each.time_s].driver == each.part.source
    sizes = [max(map(abs, each.part.share)) for each in found]
    assert sizes == sorted(sizes, reverse=True)


def test_the_verb_names_them(recorded, capsys):
    folder, trace, _ = recorded
    last = [step for step in steps_of(trace.calls) if step.phase == Phase.TRAIN][-1]
    began_s = Recording(folder).head.began_s
    assert main(["explain", str(folder), "--at", str(last.time_s - began_s), "--labels"]) == 0
    out = capsys.readouterr().out
    assert "the labels behind the novice's action" in out
    assert "like what is seen now; its share: forward" in out
