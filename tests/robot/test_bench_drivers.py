from sim_backend.emulators.rplidar import DENSE_MODE
from tools.bench import drivers


def test_dense_streams_are_parsed_without_loss_for_a_small_share_of_a_core(monkeypatch):
    monkeypatch.setattr(drivers, "STREAM_S", 2.0)
    monkeypatch.setattr(drivers, "RUNS", 3)
    row = drivers.parse_scan("dense", DENSE_MODE)
    assert row["per_s"] > 15_800
    assert row["lost_bytes"] == 0
    assert row["scans"] == 19
    assert row["core_percent"] < 15.0  # 3 on a quiet machine


def test_a_live_unit_loses_nothing(monkeypatch):
    monkeypatch.setattr(drivers, "LIVE_S", 1.5)
    row = drivers.live_scan()
    assert row["lost_bytes"] == 0
    assert row["scans"] >= 8
    assert row["age_ms_p50"] < 60.0


def test_the_base_is_heard_whole():
    assert drivers.parse_base()["per_s"] > 90
