import json

import pytest

from lira.hal.errors import ConfigError
from lira.tools.output import bench_history as history
from lira.tools.verbs.checks import bench

ROWS = [
    {"profile": "thesis-sim", "real_time_factor": 60.0, "ratio_to_bare": 1.2, "p50_ms": 3.0},
    {"profile": "rosbot2", "renderer": "egl", "real_time_factor": 20, "ratio_p99": float("nan")},
]


def entry(cpu="A", **ratios):
    return history.Entry("2025-01-31T10:00:00+00:00", cpu, 2, "0.1.0", ratios)


def test_ratios_are_kept_by_row_and_field_and_times_are_not():
    assert history.ratios(ROWS) == {
        "thesis-sim real_time_factor": 60.0,
        "thesis-sim ratio_to_bare": 1.2,
        "rosbot2 egl real_time_factor": 20.0,
    }
    beside = [{"filters": filters, "trunks": "full", "step_s": 0.2, "speedup": 2.0} for filters in (16, 32)]
    assert history.ratios(beside) == {"16 full speedup": 2.0, "32 full speedup": 2.0}


def test_a_benchmark_without_a_ratio_leaves_nothing(tmp_path):
    assert not bench.note(tmp_path / "log.jsonl", [{"labels": 1_000_000, "seconds": 2.0}])
    assert not (tmp_path / "log.jsonl").exists()


@pytest.mark.parametrize(
    ("name", "value", "bad"),
    [
        ("real_time_factor", 71.0, False),
        ("real_time_factor", 69.0, True),
        ("real_time_factor", 1000.0, False),
        ("16 full speedup", 69.0, True),
        ("ratio_p50", 129.0, False),
        ("ratio_p50", 131.0, True),
        ("ratio_p50", 1.0, False),
    ],
)
def test_a_speed_may_fall_and_a_cost_may_rise_by_thirty_per_cent(name, value, bad):
    before = [entry(**{name: old}) for old in (100.0, 99.0, 500.0)]
    assert bool(history.worse(entry(**{name: value}), before)) == bad


def test_another_machine_and_a_new_field_are_no_measure():
    before = [entry("B", real_time_factor=100.0), entry(other_ratio=1.0)]
    assert history.worse(entry(real_time_factor=1.0), before) == []


def test_what_is_worse_is_told_with_its_median():
    before = [entry(real_time_factor=old) for old in (90.0, 100.0, 110.0)]
    (line,) = history.worse(entry(real_time_factor=50.0), before)
    assert line == "real_time_factor: 50, and 100 in the median of 3 runs before"


def test_a_history_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "history" / "twin.jsonl"
    assert history.read_history(path) == []
    lines = [entry(real_time_factor=1.0), entry("B", ratio_p50=2.0)]
    for line in lines:
        history.append(path, line)
    assert history.read_history(path) == lines


def test_a_line_that_is_none_is_named(tmp_path):
    path = tmp_path / "twin.jsonl"
    history.append(path, entry())
    path.write_text(path.read_text() + "{}\n")
    with pytest.raises(ConfigError, match="line 2"):
        history.read_history(path)


def test_the_verb_notes_each_run_and_tells_a_fall_in_one_line(tmp_path, capsys):
    path = tmp_path / "twin.jsonl"
    assert not bench.note(path, ROWS)
    assert capsys.readouterr().err == ""
    assert bench.note(path, [{**ROWS[0], "real_time_factor": 30.0}])
    told = capsys.readouterr().err
    assert told.startswith("worse than before: thesis-sim real_time_factor: 30,")
    assert told.count("\n") == 1
    assert len(path.read_text().splitlines()) == 2
    assert json.loads(path.read_text().splitlines()[0])["version"]
