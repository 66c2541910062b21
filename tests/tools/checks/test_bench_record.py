"""What `lira bench record` promises: two halves side by side, the recorder's share of a core, and what it lost."""

import pytest

from lira.tools.bench import record


def test_control_is_measured_beside_a_recorder_and_without_one(monkeypatch):
    for name, value in {"TURNS": 1, "WARM_UP_S": 0.5}.items():
        monkeypatch.setattr(record, name, value)
    (row,) = record.run(0.05)
    assert row["lost"] == 0
    assert row["messages"] > 100
    assert row["cpu_share"] > 0.0
    for half in ("", "recorded_"):
        assert 0.0 < row[f"{half}p50_ms"] <= row[f"{half}p99_ms"]


@pytest.mark.parametrize(
    ("cpu_s", "lost", "slower_ms", "flat"),
    [(0.5, 0, 0.0, True), (1.5, 0, 0.0, False), (0.5, 1, 0.0, False), (0.5, 0, 3.0, False)],
)
def test_a_recorder_that_costs_loses_or_slows_too_much_is_named(cpu_s, lost, slower_ms, flat):
    answers = [4.0 + 0.01 * number for number in range(100)]
    without = record.Half(answers, seconds=10.0)
    beside = record.Half([each + slower_ms for each in answers], seconds=10.0, cpu_s=cpu_s, messages=100, lost=lost)
    assert record.row(without, beside)["flat"] is flat
