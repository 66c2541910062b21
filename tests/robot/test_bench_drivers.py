import numpy as np
import pytest

from lira.robot.rplidar.points import NOTHING, Points
from lira.tools.bench import drivers
from lira.tools.bench.parts import scan_age
from lira.tools.bench.parts.devices import COUNT, FIRST_MM, UNITS, Journal


def test_ultra_streams_are_parsed_without_loss_for_a_small_share_of_a_core(monkeypatch):
    monkeypatch.setattr(drivers, "STREAM_S", 2.0)
    monkeypatch.setattr(drivers, "RUNS", 3)
    row = drivers.parse_scan("ultra-16k", UNITS["ultra-16k"])
    assert row["per_s"] > 15_600
    assert row["lost_bytes"] == 0
    assert row["scans"] == 19
    assert row["core_percent"] < 15.0  # 4 on a quiet machine


def test_the_base_is_heard_whole():
    assert drivers.parse_base()["per_s"] > 90


def test_scans_of_a_robot_in_other_processes_are_timed_from_their_last_sample():
    row = scan_age.live("dense", 2.0)
    assert 15 <= row["scans"] <= 25
    assert row["unit_ms_p50"] > 2.5  # the next packet has to come first
    assert row["robot_ms_p50"] > 0.0
    assert row["age_ms_p50"] == pytest.approx(row["unit_ms_p50"] + row["robot_ms_p50"], abs=3.0)
    assert row["age_ms_p50"] < 60.0  # 6 on a quiet machine


def test_a_line_that_is_read_loses_no_sample():
    row = scan_age.endurance("express", 1.5)
    assert row["points"] > 4000
    assert (row["missing"], row["lost_bytes"]) == (0, 0)


def test_missing_samples_are_noticed():
    pieces = [np.arange(0, 5), np.arange(5, 8), NOTHING, np.arange(10, 12), np.arange(0, 3)]
    metres = iter([(piece + FIRST_MM) / 1000.0 for piece in pieces])

    class Decoder:
        size, back_rad, left = 5, 0.0, 0

        def feed(self, data):
            distance_m = next(metres)
            return Points(distance_m, distance_m)

    checked = scan_age.Checked(Decoder())
    seen = []
    for _ in pieces:
        checked.feed(b"")
        seen.append(checked.missing)
    assert seen == [0, 0, 0, 2, 2 + COUNT - 12]


def test_ages_are_reckoned_from_the_units_own_clockwork():
    # Dense: a turn of 100 ms is 1000 samples; the unit began at a seam, so sample 1000 opens the second turn.
    began_s = 10.05
    notes = [(began_s + 0.1 + 0.005 * (1 + packet), 1000 + 40 * (1 + packet)) for packet in range(4)]
    journal = Journal(began_s, notes, 0, (10.0, 10.0, 0.0))
    row = scan_age.ages([(began_s + 0.1, began_s + 0.1075)], journal, "dense")
    taken_s = began_s + 999 * 100e-6
    assert row["unit_ms_p50"] == pytest.approx(1e3 * (began_s + 0.105 - taken_s))
    assert row["robot_ms_p50"] == pytest.approx(2.5)
    assert row["age_ms_p50"] == pytest.approx(row["unit_ms_p50"] + 2.5)
