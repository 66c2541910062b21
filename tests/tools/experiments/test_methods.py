"""Every kind of method, taught for a lap on a short world."""

import pytest
from short_trials import write_world

from lira.fusion.methods.presets import METHODS, Preset
from lira.fusion.methods.rivals.ensemble_dagger import EnsembleDaggerSettings
from lira.fusion.policies.kernel import KernelSettings
from lira.fusion.teaching.teacher import PERFECT
from lira.tools.experiments.trial import Trial, play

KINDS = (
    *("hold-fixed", "hold-scratch", "hold-mirrored", "hg-dagger-warm", "hg-dagger-doubt", "cloning", "switching"),
    *("plus", "plus-ask", "hg-dagger-kernel"),
    *("ensemble-dagger", "lazy-dagger-kernel", "thrifty-dagger-kernel", "iwr-kernel"),
)
ASKING = Preset("asking", EnsembleDaggerSettings(chi=1e-4), kernel=KernelSettings())  # it doubts nearly everywhere


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    world = write_world(tmp_path_factory.mktemp("world"))
    trials = {name: Trial(METHODS[name], world, 0, "perfect", PERFECT, laps=1, unseen=1) for name in KINDS}
    trials["asking"] = Trial(ASKING, world, 0, laps=2, all_laps=True, unseen=1)  # a hand that takes a moment
    return {name: play(trial) for name, trial in trials.items()}


def test_all_of_them_end_with_laps_and_a_result(outcomes):
    for name, outcome in outcomes.items():
        phases = [lap.phase for lap in outcome.laps]
        assert phases[-1] == "unseen", name
        if name != "switching":
            assert phases[0] == "train", name
            assert outcome.result.buffer > 0, name
            assert outcome.result.laps == outcome.trial.laps, name


def test_by_the_switching_rule_nobody_learns_and_both_experts_drive(outcomes):
    outcome = outcomes["switching"]
    assert (outcome.result.buffer, outcome.result.training_steps, outcome.result.laps) == (0, 0, 0)
    assert [lap.phase for lap in outcome.laps] == ["prove", "unseen"]
    assert outcome.after(1).phase == "prove"
    assert {driver for track in outcome.tracks for driver in track.drivers} == {"camera", "lidar"}


def test_cloning_is_the_humans_drive_alone_trained_at_the_end_of_the_lap(outcomes):
    outcome = outcomes["cloning"]
    assert set(outcome.labels) == {"demonstration"}
    assert outcome.result.demonstration == outcome.result.buffer == len(outcome.labels["demonstration"])
    assert outcome.after(1).training_steps == 0  # the lap's record is written before
    assert outcome.result.training_steps == outcome.result.buffer // 30
    assert [lap.phase for lap in outcome.laps] == ["train", "prove", "unseen"]


def test_a_warm_start_trains_before_the_human_comes(outcomes):
    assert outcomes["hg-dagger-warm"].result.demonstration == 0
    assert outcomes["hg-dagger-warm"].result.training_steps > outcomes["hg-dagger-warm"].result.buffer // 30


def test_who_learns_from_every_label_counts_as_many_training_steps_as_labels(outcomes):
    for name in ("plus", "hg-dagger-kernel"):
        assert outcomes[name].result.training_steps == outcomes[name].result.buffer
        assert outcomes[name].result.proof == "fresh:3"


def test_plus_is_proven_on_layouts_that_it_was_not_taught(outcomes):
    layouts = {
        phase: {lap.layout for lap in outcomes["plus"].laps if lap.phase == phase} for phase in ("train", "prove")
    }
    assert not layouts["train"] & layouts["prove"]


def test_a_robot_that_asks_is_answered_and_the_answers_are_learned(outcomes):
    result = outcomes["asking"].result
    assert result.calls > 0
    assert result.account.called_for > 0
    assert result.human_labels > 0
    assert sum(lap.collisions + lap.lost for lap in outcomes["asking"].laps if lap.phase == "train") == 0


def test_what_was_left_alone_is_learned_beside_what_the_human_did(outcomes):
    assert set(outcomes["iwr-kernel"].labels) <= {"demonstration", "human"}  # the robot's own are nobody's labels
    assert outcomes["iwr-kernel"].result.training_steps >= outcomes["iwr-kernel"].result.buffer
