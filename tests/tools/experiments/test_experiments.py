"""Experiments: statistics against numbers worked out by hand, and real trials on a short world."""

import numpy as np
import psutil
import pytest
from msgspec.structs import replace
from short_trials import short_trial, timeless, write_world

from lira.fusion.methods.presets import METHODS
from lira.hal.errors import StorageError
from lira.tools.cli import main
from lira.tools.experiments.effort.statistics import bootstrap, iqm, median_interval, paired_ratios
from lira.tools.experiments.playing.kept import kept
from lira.tools.experiments.playing.pools import Here
from lira.tools.experiments.playing.runner import run_trials
from lira.tools.experiments.studies.compare import ratios, summary
from lira.tools.experiments.trial import play


@pytest.fixture
def world(tmp_path):
    return write_world(tmp_path)


def test_interquartile_mean_leaves_out_both_ends():
    assert iqm([100.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -50.0]) == pytest.approx((2 + 3 + 4 + 5) / 4)
    assert iqm([7.0]) == 7.0


def test_the_bootstrap_interval_holds_the_true_median_about_as_often_as_it_says():
    random = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        _, low, high = median_interval(random.normal(3.0, 1.0, size=15).tolist())
        hits += low <= 3.0 <= high
    assert 175 <= hits <= 200


def test_the_bootstrap_is_repeatable_and_collapses_for_equal_values():
    values = [1.0, 5.0, 2.0, 8.0]
    assert median_interval(values) == median_interval(values)
    assert median_interval([2.0, 2.0, 2.0]) == (2.0, 2.0, 2.0)
    assert bootstrap([1.0, 3.0], lambda x: x.mean(axis=1)) == (1.0, 3.0)


def test_a_ratio_stays_finite_where_no_help_was_needed():
    assert paired_ratios([10, 6], [5, 0]) == [2.0, 12.0]


def test_trials_do_not_depend_on_the_number_of_workers_and_resume(world, tmp_path):
    trials = [
        short_trial(world),
        short_trial(world, name="hg-dagger", lira=None),
    ]
    alone = run_trials(trials, tmp_path / "alone", Here(1))
    together = run_trials(trials, tmp_path / "together", Here(2))
    assert [timeless(each) for each in alone] == [timeless(each) for each in together]
    assert not [child for child in psutil.Process().children() if "LokyProcess" in " ".join(child.cmdline())]
    assert alone[0].result.buffer > 0
    again = run_trials(trials, tmp_path / "alone", Here(1))
    assert again == alone  # to the wall-clock time: read, not run

    rows = summary(alone)
    assert [(row["method"], row["n"]) for row in rows] == [("hold", 1), ("hg-dagger", 1)]
    pair = {row["quantity"]: row for row in ratios(alone)}
    expected = paired_ratios([alone[1].result.human_labels], [alone[0].result.human_labels])[0]
    assert pair["human_labels"]["median"] == pytest.approx(expected)
    assert pair["human_labels"]["censored"] == int(not all(each.result.converged for each in alone))


def test_who_knows_no_experts_is_played_once_for_all_pairs_of_them(world, tmp_path):
    alone = replace(short_trial(world), method=METHODS["hg-dagger"])
    elsewhere = replace(alone, experts="passage")
    assert timeless(play(elsewhere)) == replace(timeless(play(alone)), trial=elsewhere)  # so that once is enough

    played = []

    def pool(trials):
        played.extend(trials)
        return Here(1)(trials)

    outcomes = run_trials([alone, elsewhere], tmp_path, pool)
    assert played == [alone]
    assert [outcome.trial for outcome in outcomes] == [alone, elsewhere]
    assert outcomes[1] == replace(outcomes[0], trial=elsewhere)
    assert run_trials([elsewhere], tmp_path, pool) == outcomes[1:]
    assert played == [alone]


def test_whose_outcome_depends_on_the_experts_is_known():
    alone = {name for name, method in METHODS.items() if not method.knows_experts}
    assert {"hg-dagger", "hg-dagger-m10", "cloning", "thrifty-dagger", "iwr-fresh"} <= alone
    others = {"hold-scratch", "plus", "switching", "hg-dagger-trunks", "hg-dagger-warm", "hg-dagger-kernel"}
    assert not alone & others


def test_an_outcome_that_is_damaged_is_named(world, tmp_path):
    trial = short_trial(world)
    (tmp_path / trial.file).write_text("{")
    with pytest.raises(StorageError, match="Delete it"):
        kept(trial, tmp_path)


def test_the_command_refuses_what_makes_no_sense(capsys):
    for option in ("--seeds", "--workers", "--laps"):
        assert main(["experiment", "unseen", option, "0"]) == 2
        assert "'0' is not a whole number from 1 on" in capsys.readouterr().err
    assert main(["experiment", "table9"]) == 2
    what, remedy = capsys.readouterr().err.splitlines()
    assert what == "lira experiment: unknown experiment 'table9'"
    assert "table2, race" in remedy
