"""The fields that `lira bench lockstep` and `lira bench latency` promise. How fast they are is for the benchmarks."""

import pytest

from lira.tools.bench import latency, lockstep


def test_lockstep_drives_learns_and_tells_how_fast(monkeypatch):
    for name, value in {"RUNS": 1, "WARM_UP_S": 1.0, "SIMULATED_S": 9.0}.items():
        monkeypatch.setattr(lockstep, name, value)
    (row,) = lockstep.run()
    assert (row["profile"], row["world"], row["steps"]) == ("thesis-sim", "race", 45)
    assert row["runs"] == [row["real_time_factor"]]
    assert row["real_time_factor"] > 0
    assert row["labels"] > 0


def test_latency_compares_the_stack_with_a_bare_echo(monkeypatch):
    for name, value in {"RUNS": 1, "SCANS": 10, "WARM_UP": 2}.items():
        monkeypatch.setattr(latency, name, value)
    (row,) = latency.run()
    for name in ("p50", "p99"):
        assert row[f"{name}_ms"] > 0
        assert row[f"ratio_{name}"] == pytest.approx(row[f"{name}_ms"] / row[f"echo_{name}_ms"])
