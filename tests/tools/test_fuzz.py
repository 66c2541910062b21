"""A seeded part of the fuzz bench, and that it would notice."""

import random

import pytest

from hal.ros import CODECS
from tools.bench import BENCHES, fuzz
from tools.bench.soak import growth
from tools.cli import main


def test_garbage_ends_in_a_value_or_in_the_decoders_own_error():
    rows = fuzz.run(6000)
    assert sum(row["inputs"] for row in rows) >= 6000
    assert all(row["refused"] > 0 or row["decoder"] == "attachment" for row in rows)
    names = {row["decoder"] for row in rows}
    assert names >= {kind.__name__ for kind in CODECS}


def test_another_error_is_told_with_the_input():
    def bad(data):
        raise KeyError("no such thing")

    with pytest.raises(AssertionError, match=r"mine: KeyError on [0-9a-f]*"):
        fuzz.attack(fuzz.Target("mine", bad, (ValueError,), (b"abc",)), 5, random.Random(1))


def test_growth_is_that_of_the_median():
    assert growth([5, 5, 5, 9, 5, 5, 5, 5, 5]) == 0
    assert growth([1, 1, 1, 2, 2, 2, 3, 3, 3]) == 2


def test_both_are_benches_and_minutes_are_the_soaks_alone(capsys):
    assert {"fuzz", "soak"} <= set(BENCHES)
    assert main(["bench", "twin", "--minutes", "1"]) == 2
    assert "soak" in capsys.readouterr().err
