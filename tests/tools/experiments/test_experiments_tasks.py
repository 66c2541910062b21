"""The experiments of the passage and the corridor: real drives of the experts, tables from outcomes made to measure."""

import msgspec
import pytest

from lira.fusion.inference.checkpoint import Checkpoint, save_checkpoint
from lira.fusion.log.run_log import LapRecord, ResultRecord
from lira.fusion.policies.networks import ExpertNet
from lira.tools.experiments.studies import corridor, passage, table1
from lira.tools.experiments.trial import Outcome
from lira.tools.runs import expert_training as training

LAP = LapRecord("train", 1, 0, True, False, 30.0, 0, 0, 0.1, 20, 5, 9, 80, 2, 1.0)


def outcome(trial, *, converged=True, **counts):
    """An outcome with these totals, and one collision on one unseen layout."""
    lap = msgspec.structs.replace(LAP, **counts)
    unseen = msgspec.structs.replace(lap, phase="unseen", passed=False, collisions=1)
    totals = {
        name: getattr(lap, name) for name in ("human_labels", "interventions", "calls", "buffer", "training_steps")
    }
    result = ResultRecord(converged=converged, laps=1, demonstration=31, simulated_s=1.0, elapsed_s=1.0, **totals)
    return Outcome(trial, (lap, unseen), result, {}, ())


def test_table_3_holds_lira_against_hg_dagger():
    few, many = {"human_labels": 50, "interventions": 6, "buffer": 160}, {"human_labels": 90, "interventions": 13}
    outcomes = [outcome(trial, **(many if trial.method.name == "hg-dagger" else few)) for trial in corridor.trials(2)]
    table, _ = corridor.tables(outcomes)
    assert [row["method"] for row in table.rows] == [*corridor.NAMES, "thesis: LIRA-SPF", "thesis: HG-DAgger"]
    assert table.rows[0]["human_labels"] == 50
    assert table.rows[0]["collisions_afterwards"] == 1
    assert all(finding.agrees for finding in corridor.findings(outcomes))
    turned = [outcome(each.trial, **(few if each.trial.method.name == "hg-dagger" else many)) for each in outcomes]
    assert not any(finding.agrees for finding in corridor.findings(turned))


def test_table_1_reads_what_the_experts_took_from_their_files(tmp_path):
    for network, labels in ((ExpertNet("image", (32, 32), 16), 200), (ExpertNet("scan", (101,)), 300)):
        about = Checkpoint.of(network, "thesis-sim", "", 0, (1.0, 0.0))
        about.labels, about.training_steps = labels, labels // 30
        save_checkpoint(tmp_path / f"{network.kind}.safetensors", network, about)
    trials = [msgspec.structs.replace(trial, experts=str(tmp_path)) for trial in table1.trials(2)]
    outcomes = [outcome(trial, buffer=buffer) for trial, buffer in zip(trials, (40, 60, 400, 600), strict=True)]
    rows = {row["policy"]: row for row in table1.tables(outcomes)[0].rows}
    assert [rows[f"{kind} expert"]["labels"] for kind in ("lidar", "camera")] == [300, 200]
    assert [rows[f"novice, {preset}"]["labels"] for preset in ("thesis", "hold")] == [50, 500]
    assert rows["lidar expert"]["thesis_labels"] == 210
    assert [finding.agrees for finding in table1.findings(outcomes)] == [True, False]


def test_table_1_has_its_experts_trained_anew():
    assert {trial.pair for trial in table1.trials(2)} == {"passage@0"}


def test_an_expert_drives_the_passage_alone():
    record, track = passage.alone("lidar", passage.trials(1)[0])
    assert record.phase == "prove"
    assert track.x_mm[0] == pytest.approx(0, abs=250)
    assert max(track.x_mm) > 3000
    assert passage.end(record, track) == "collided"  # in the gap, whose lintel it cannot see
    assert passage.side_m(track) is None


def test_a_pair_is_trained_where_it_is_missing_and_only_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = []

    def train(kind, task, profile, seed, path, command):
        asked.append((kind, task, profile.name, seed))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"trained")
        return True

    monkeypatch.setattr(training, "train_expert", train)
    for pair in ("corridor@2", "corridor@2", "line", str(tmp_path)):
        training.provide(pair)
    assert asked == [("camera", "corridor", "rosbot2", 2), ("lidar", "corridor", "rosbot2", 2)]
