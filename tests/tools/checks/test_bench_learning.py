"""The fields that `lira bench preprocess` and `lira bench train` promise. How fast they are is for the benchmarks."""

import time

import numpy as np
import pytest
from short_trials import write_world

from lira.fusion.control import ControlLoop
from lira.fusion.modalities.image import gray_image
from lira.hal.messages import CompressedImage
from lira.tools.bench.learning import decide, log, preprocess, step, train


def test_preprocess_compares_two_ways_to_the_same_image(monkeypatch):
    compared = []
    decode_whole = preprocess.decode_whole

    def compare(image: CompressedImage):
        compared.append(np.abs(decode_whole(image) - gray_image(image, 32)).max())
        return decode_whole(image)

    monkeypatch.setattr(preprocess, "decode_whole", compare)
    monkeypatch.setattr(preprocess, "RUNS", 1)
    monkeypatch.setattr(preprocess, "REPEATS", 2)
    rows = preprocess.run()
    assert rows[0]["input"] == "jpeg 640x480"
    assert rows[0]["speedup"] > 0
    assert max(compared) < 5 / 255


def test_decide_has_a_row_per_network_and_kind_of_trunks(monkeypatch):
    for name, value in {"RUNS": 1, "DECISIONS": 2}.items():
        monkeypatch.setattr(decide, name, value)
    rows = decide.run()
    assert [(row["filters"], row["trunks"]) for row in rows] == [
        (f, each) for f in (16, 32) for each in ("shared", "own")
    ]
    assert all(row["ms"] > 0 and row["torch_ms"] > 0 and row["speedup"] > 0 for row in rows)


def test_train_has_a_row_per_network_and_kind_of_training(monkeypatch):
    for name, value in {"RUNS": 1, "LABELS": 20, "UPDATES": 2, "TRAINING_STEPS": 1, "BINS": {16: 101}}.items():
        monkeypatch.setattr(train, name, value)
    rows = train.run()
    assert [(row["filters"], row["trunks"]) for row in rows] == [(16, "full"), (16, "frozen")]
    for row in rows:
        assert row["speedup"] > 0
        assert row["decisions"] >= 1
        assert 0 <= row["deadline_misses"] <= row["decisions"]


def test_train_is_put_beside_keras_where_that_is_installed(monkeypatch):
    class Stands:  # in for Keras
        def __init__(self, filters, labels, updates, batch):
            self.known = (filters, len(labels), updates, batch)

        def train_step(self):
            assert self.known == (16, 20, 2, train.BATCH)
            time.sleep(0.5)

    for name, value in {"RUNS": 1, "LABELS": 20, "UPDATES": 2, "TRAINING_STEPS": 1, "BINS": {16: 101}}.items():
        monkeypatch.setattr(train, name, value)
    monkeypatch.setattr(train.keras_reference, "installed", lambda: True)
    monkeypatch.setattr(train.keras_reference, "KerasLearner", Stands)
    rows = train.run()
    assert rows
    assert all(row["keras_speedup"] * row["step_s"] > 0.499 for row in rows)  # Keras's seconds, on any machine


def test_log_writes_opens_and_learns_all_labels_and_says_what_memory_that_takes(monkeypatch):
    monkeypatch.setattr(log, "LABELS", 300)
    rows = log.run()
    assert [row["what"] for row in rows] == ["append", "open again", "read and learn", "one training step"]
    assert all(row["labels"] == 300 and row["rss_mb"] > 0 for row in rows)
    assert rows[0]["file_mb"] > 300 * 1.4e-3


def test_step_divides_the_time_of_every_step_among_its_parts(monkeypatch, tmp_path):
    monkeypatch.setattr(step, "WORLD", write_world(tmp_path))
    monkeypatch.setattr(step, "LAPS", 1)
    rows = {row["part"]: row for row in step.run()}
    assert rows["teacher: look ahead"]["steps"] <= rows["a decision step"]["steps"]
    assert sum(row.get("share_percent", 0.0) for row in rows.values()) == pytest.approx(100.0)
    assert rows["the whole run"]["laps"] == 1
    assert ControlLoop.step.__name__ == "step"  # nothing stays behind


def test_the_stopwatch_gives_every_part_its_own_time(monkeypatch):
    now = iter([0.0, 1.0, 4.0, 6.0])
    monkeypatch.setattr(step.time, "perf_counter", lambda: next(now))
    watch = step.Stopwatch()
    inner = watch.around("inner", lambda: None)
    watch.around("loop", inner)()
    assert watch.steps == [{"loop": 1.0 + 2.0, "inner": 3.0}]
