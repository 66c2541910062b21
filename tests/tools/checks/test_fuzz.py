"""A seeded part of the fuzz bench, and that it would notice."""

import random

import pytest

from lira.hal.messages import Source
from lira.hal.messages.ros.codec import CODECS
from lira.tools.bench import BENCHES, fuzz
from lira.tools.bench.soak import Watched, Work, growth, rise
from lira.tools.cli import main
from lira.tools.verbs.checks.bench import exit_status


def test_garbage_ends_in_a_value_or_in_the_decoders_own_error():
    rows = fuzz.run(6000)
    assert sum(row["inputs"] for row in rows) >= 6000
    assert all(row["refused"] > 0 for row in rows)
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


def test_a_leak_is_told_from_noise_peaks_and_a_late_first_use():
    noise = random.Random(1)
    flat = [50_000 + noise.randint(-300, 300) + (9000 if step % 97 == 0 else 0) for step in range(1800)]
    assert abs(rise(flat)) < 200
    assert rise([kb + 5 * step for step, kb in enumerate(flat)]) == pytest.approx(5 * 1800, rel=0.05)
    assert rise([7]) == 0.0


def test_a_row_fails_for_a_leak_of_memory_threads_or_files():
    for rss, threads, files, flat in (
        (0, 0, 0, True),
        (60, 0, 0, False),
        (0, 1, 0, False),
        (0, 0, 1, False),
    ):
        steps = range(100)
        watched = Watched("x", None, *([9 + step * more for step in steps] for more in (rss, threads, files)))
        assert watched.row()["flat"] is flat
    assert exit_status([watched.row()]) == 1
    assert exit_status([{"inputs": 1}]) == 0


def test_a_soak_in_which_nobody_drives_fails():
    work = Work()
    for source in (Source.NONE, Source.POLICY, Source.TELEOP):
        work.note(source, moving=source is Source.POLICY)
    assert not work.row()["flat"]
    for source in (Source.POLICY, Source.TELEOP):
        work.note(source, moving=True)
        work.note(Source.POLICY, moving=True)
    assert work.row()["flat"]


def test_both_are_benches_and_minutes_are_the_soaks_alone(capsys):
    assert {"fuzz", "soak"} <= set(BENCHES)
    assert main(["bench", "twin", "--minutes", "1"]) == 2
    assert "soak" in capsys.readouterr().err
