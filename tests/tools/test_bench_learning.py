"""The fields that `lira bench preprocess` and `lira bench train` promise. How fast they are is for the benchmarks."""

import numpy as np

from fusion.preprocess import gray_image
from hal.messages import CompressedImage
from tools.bench import preprocess, train


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


def test_train_has_a_row_per_network_and_kind_of_training(monkeypatch):
    for name, value in {"RUNS": 1, "LABELS": 20, "UPDATES": 2, "TRAINING_STEPS": 1, "BINS": {16: 101}}.items():
        monkeypatch.setattr(train, name, value)
    rows = train.run()
    assert [(row["filters"], row["trunks"]) for row in rows] == [(16, "full"), (16, "frozen")]
    for row in rows:
        assert row["speedup"] > 0
        assert row["decisions"] >= 1
        assert 0 <= row["deadline_misses"] <= row["decisions"]
