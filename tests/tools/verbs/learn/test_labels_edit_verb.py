"""`lira labels list|undo|redo|explain|merge` on what a run leaves in its folder."""

import json
from dataclasses import replace

import numpy as np
import pytest

from lira.fusion.experts.load import load_alone
from lira.fusion.inference.checkpoint import load_checkpoint, save_checkpoint
from lira.fusion.inference.kernel_net import KernelNet
from lira.fusion.learning.kernel_novice import KernelNovice
from lira.fusion.learning.labels import Label
from lira.fusion.learning.novice import LearningSettings
from lira.fusion.log.label_log import Demonstration, DemonstrationLog, read_demonstrations
from lira.fusion.log.run_log import ResultRecord, RunRecord, RunWriter, VerdictRecord
from lira.fusion.policies.kernel import KernelSettings
from lira.fusion.policies.networks import ExpertNet
from lira.fusion.preprocess import Features
from lira.hal.errors import ConfigError
from lira.hal.profile import load_profile
from lira.tools.cli import main
from lira.tools.labels.relearn import relearn
from lira.tools.output.proven import contradiction_words
from lira.tools.output.when import when
from lira.tools.report import write_report
from lira.tools.report.digest import load_run
from lira.tools.report.page import outcome
from lira.tools.runs.folder import in_the_log, snapshot
from lira.tools.runs.names import LABELS, NOVICE, RECORD

SIM = load_profile("thesis-sim")
HEAD = RunRecord("line-obstacles", SIM.name, "plus", "plus", 0, 0, "lira demo", "0")
# Two scenes, seen again and again: in the first all but the seventh label turn left, in the second nobody turns.
SCENES = [np.random.default_rng(k) for k in (1, 2)]
SEEN = [Features(scan=rng.random(101, np.float32), image=rng.random((32, 32), np.float32)) for rng in SCENES]
GIVEN = [("camera", 0, 0.9)] * 4 + [("human", 1, 0.0)] * 2 + [("camera", 0, -0.9)] + [("human", 0, 0.9)] * 3


def labels(began_s=0.0):
    for k, (source, scene, turn) in enumerate(GIVEN):
        yield Demonstration(began_s + 0.2 * k, k, 1, source, (1.0, turn), (0.0, 0.0), True, SEEN[scene])


@pytest.fixture
def folder(tmp_path):
    trunks = KernelNet.from_experts([ExpertNet("image", (32, 32), 16, seed=1), ExpertNet("scan", (101,), seed=2)])
    novice = KernelNovice(trunks, LearningSettings(human_weight=3.0), KernelSettings(), mirrored=True)
    with DemonstrationLog(tmp_path / LABELS, SIM, mirrored=True) as log, RunWriter(tmp_path / RECORD) as record:
        record.write(HEAD)
        for label in labels():
            log.append(label)
            weight = novice.weight(label.source)
            novice.remember(Label(label.features, label.action, label.source, weight))
        said = snapshot(tmp_path, novice, SIM, HEAD)()
    assert "this label contradicts the rest and is not followed: 6 (camera, lap 1, 1.2 s: turn -0.90" in said
    return tmp_path


def turn(folder, scene):
    network, _ = load_checkpoint(folder / NOVICE)
    return network.act(SEEN[scene])[1]


def lira(capsys, *words):
    status = main(["labels", *map(str, words)])
    return status, capsys.readouterr()


def test_the_folder_of_a_run_stands_for_its_log(folder, tmp_path, capsys):
    assert lira(capsys, "list", folder)[1].out == lira(capsys, "list", folder / LABELS)[1].out
    empty = tmp_path / "empty"
    empty.mkdir()
    status, said = lira(capsys, "list", empty)
    assert status == 2
    assert f"{empty / LABELS}" in said.err


@pytest.mark.parametrize("began_s", [5.0, 5.04, 1.79e9, 1.79e9 + 0.07])
def test_a_label_has_the_same_time_wherever_it_is_named(folder, capsys, began_s):
    (folder / LABELS).unlink()
    with DemonstrationLog(folder / LABELS, SIM, mirrored=True) as log:
        for label in labels(began_s):
            log.append(label)
    time = when(began_s + 1.2)
    (aside,) = in_the_log(folder / LABELS, relearn(folder / LABELS)[0].set_aside())
    assert f": 6 (camera, lap 1, {time}: turn -0.90, the others" in contradiction_words([aside])
    assert time in lira(capsys, "list", folder)[1].out.splitlines()[-4]
    assert f"label 6 (run 0, lap 1, {time})" in lira(capsys, "explain", folder, "--time", time)[1].out
    said = lira(capsys, "list", folder, "--from", time, "--to", time, "--json", "-")[1].out
    assert [row["number"] for row in json.loads(said)["labels"]] == [6]


def test_a_time_that_is_none_is_refused(folder, capsys):
    status, said = lira(capsys, "list", folder, "--from", "noon")
    assert status == 2
    assert "'noon' is no time like 41.2 or '2026-11-27 10:15:00.2'" in said.err


def test_the_list_says_what_became_of_each_label(folder, capsys):
    status, said = lira(capsys, "list", folder / LABELS)
    assert status == 0
    lines = said.out.splitlines()[-len(GIVEN) :]
    assert [line.split()[0] for line in lines] == [str(k) for k in range(len(GIVEN))]
    assert [number for number, line in enumerate(lines) if line.endswith("contradicts the rest")] == [6]


@pytest.mark.parametrize(
    ("words", "numbers"),
    [
        (["--source", "human"], [4, 5, 7, 8, 9]),
        (["--source", "camera", "--from", "0.6"], [3, 6]),
        (["--to", "0.2"], [0, 1]),
        (["--number", "2", "5-6"], [2, 5, 6]),
        (["--run", "0"], list(range(10))),
    ],
)
def test_the_list_is_of_the_labels_that_are_meant(folder, capsys, words, numbers):
    status, said = lira(capsys, "list", folder, *words, "--json", "-")
    assert status == 0
    assert [row["number"] for row in json.loads(said.out)["labels"]] == numbers
    said = lira(capsys, "list", folder, *words)[1].out
    assert f"here {len(numbers)} of them" in said
    assert [int(line.split()[0]) for line in said.splitlines()[-len(numbers) :]] == numbers


def test_the_last_intervention_is_taken_back_and_the_novice_knows_it_no_more(folder, capsys):
    before = turn(folder, 0)
    status, said = lira(capsys, "undo", folder / LABELS)
    assert (status, said.out.splitlines()[0]) == (0, "taken back: 3 labels 7-9")
    assert "was learned anew from 7 labels; it has not been proven since" in said.out
    assert turn(folder, 0) < before - 0.01
    assert f"lira labels redo {folder / LABELS} --number 7-9" in said.out
    status, said = lira(capsys, "redo", folder / LABELS)
    assert said.out.splitlines()[0] == "learned again: 3 labels 7-9"
    assert turn(folder, 0) == pytest.approx(before, abs=1e-3)


def test_a_novice_that_is_learned_anew_takes_sides_as_the_labels_that_are_left_say(folder, capsys):
    network, about = load_checkpoint(folder / NOVICE)
    save_checkpoint(folder / NOVICE, network, replace(about, sides=True))
    lira(capsys, "undo", folder)
    assert not relearn(folder / LABELS)[0].takes_sides
    assert not load_checkpoint(folder / NOVICE)[1].sides


PROVEN = ResultRecord(True, 1, 5, 0, 2, 3, 10, 10, 60.0, 6.0, proof="fresh:3")


def ended(folder, *records):
    """Let a run end with these; return what its report says of that."""
    with RunWriter(folder / RECORD) as record:
        for each in records:
            record.write(each)
    return outcome(load_run(folder / RECORD))


def test_a_report_says_that_labels_were_taken_back_since_it_was_proven(folder, capsys):
    proven = "Proven after 1 training lap: the novice alone passed 3 fresh layouts in a row"
    assert ended(folder, PROVEN) == (proven, "good")
    assert f"lira report {folder}" in lira(capsys, "undo", folder)[1].out
    since = f"{proven}; since then: 3 labels taken back; the novice of what is left has not been proven"
    assert ended(folder) == (since, "muted")
    assert since in write_report(folder).read_text()
    lira(capsys, "redo", folder, "--number", "7")
    assert "since then: 3 labels taken back and 1 label learned again; the novice" in ended(folder)[0]
    assert ended(folder, HEAD, PROVEN) == (proven, "good")


def test_a_verdict_is_of_the_labels_that_there_were(folder, capsys):
    said = "It drove 12 of 12 unseen layouts"
    assert ended(folder, PROVEN, VerdictRecord("ada", said, True)) == (said, "good")
    lira(capsys, "undo", folder, "--number", "2")
    assert ended(folder)[0] == f"{said}; since then: 1 label taken back; the novice of what is left has not been proven"


def test_nothing_is_noted_where_nothing_changed_or_there_is_no_run(folder, capsys):
    lira(capsys, "redo", folder)
    assert ended(folder, PROVEN)[1] == "good"
    (folder / RECORD).unlink()
    assert lira(capsys, "undo", folder)[0] == 0
    assert not (folder / RECORD).exists()


def test_a_novice_that_was_not_proven_since_does_not_claim_to_know_what_it_does_not(folder, capsys):
    network, about = load_checkpoint(folder / NOVICE)
    proven = KernelNet(network.architecture, network.weights() | {"limit": np.ones(1, np.float32)})
    save_checkpoint(folder / NOVICE, proven, about)
    assert load_alone(f"{folder / NOVICE}", SIM, ask=True)
    lira(capsys, "undo", folder)
    with pytest.raises(ConfigError, match="was not proven after its last label"):
        load_alone(f"{folder / NOVICE}", SIM, ask=True)


def test_labels_are_taken_back_by_number_by_source_and_by_time(folder, capsys):
    log = folder / LABELS

    def stored():
        return [number for number, each in enumerate(read_demonstrations(log)) if each.stored]

    lira(capsys, "undo", log, "--number", "0-1", "4")
    assert stored() == [2, 3, 5, 6, 7, 8, 9]
    lira(capsys, "undo", log, "--source", "camera", "--from", "0.6")
    assert stored() == [2, 5, 7, 8, 9]
    lira(capsys, "undo", log, "--from", "1.6", "--to", "1.6")
    assert stored() == [2, 5, 7, 9]
    lira(capsys, "redo", log)
    assert stored() == list(range(10))


def test_what_makes_an_action_is_named_and_adds_up(folder, capsys):
    status, said = lira(capsys, "explain", folder / LABELS, "--number", "4", "--json", "-")
    found = json.loads(said.out)
    assert status == 0
    assert np.sum([part["share"] for part in found["parts"]], axis=0) == pytest.approx(found["action"])
    likest = {part["number"] for part in found["parts"] if part["likeness"] > 0.99}
    assert likest == {4, 5}
    assert {part["number"] for part in found["parts"]} == set(range(10))
    status, said = lira(capsys, "explain", folder / LABELS, "--time", "0.81")
    assert said.out.startswith("label 4 (run 0, lap 1, 0.8 s) says +1.00, +0.00 by human (learned); the novice does +")


def test_what_became_of_a_label_is_told_alike_by_list_and_explain_whatever_was_undone(folder, capsys):
    def told(number):
        rows = lira(capsys, "list", folder / LABELS)[1].out.splitlines()[-len(GIVEN) :]
        became = lira(capsys, "explain", folder / LABELS, "--number", str(number))[1].out
        state = became.partition("(run 0")[2].partition("(")[2].partition(")")[0]
        assert rows[number].endswith(state)
        return state

    assert told(6) == "contradicts the rest"
    lira(capsys, "undo", folder / LABELS, "--number", "6")
    assert told(6) == "taken back"
    lira(capsys, "redo", folder / LABELS, "--number", "6")
    assert told(6) == "contradicts the rest"
    lira(capsys, "undo", folder / LABELS, "--number", "0-3", "7-9")  # nobody is left whom it could contradict
    assert told(6) == "learned"


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["redo", "--number", "4"], "nothing changed with 4: learned already"),
        (["redo", "--number", "1", "4"], "nothing changed with 4: learned already"),
        (["redo", "--number", "10"], "nothing changed with 10: redundant or objected to"),
        (["undo", "--number", "1-2"], "nothing changed with 1: taken back already"),
        (["undo", "--number", "10"], "nothing changed with 10: redundant or objected to"),
        (["redo"], "learned again: 1 label 1"),
    ],
)
def test_a_label_with_which_nothing_changes_is_named_and_why(folder, capsys, words, why):
    with DemonstrationLog(folder / LABELS, SIM, mirrored=True) as log:
        log.append(replace(next(labels()), stored=False))
    lira(capsys, "undo", folder, "--number", "1")
    status, said = lira(capsys, words[0], folder, *words[1:])
    assert status == 0
    assert why in said.out


def test_to_learn_again_what_nobody_took_back_says_so(folder, capsys):
    status, said = lira(capsys, "redo", folder)
    assert (status, said.out.splitlines()) == (0, ["learned again: 0 labels", "no label of this log is taken back"])


def test_two_logs_become_one(folder, capsys, tmp_path):
    status, said = lira(capsys, "merge", folder / LABELS, folder / LABELS, "-o", tmp_path / "both.lira")
    assert status == 0
    assert "10 labels given; 10 of them are in both, and kept once" in said.out


@pytest.mark.parametrize(
    "words",
    [
        ["undo", "LOG", "--number", "10"],
        ["undo", "LOG", "--number", "7-3"],
        ["undo", "LOG", "--source", "lidar"],
        ["undo", "LOG", "LOG"],
        ["explain", "LOG"],
        ["explain", "LOG", "--number", "1", "--time", "3"],
        ["explain", "LOG", "--number", "1-2"],
        ["explain", "LOG", "--time", "3", "--run", "5"],
        ["merge", "LOG", "-o", "x"],
        ["merge", "LOG", "LOG"],
        ["list", "NONE"],
        ["list", "LOG", "--source", "nobody"],
        ["list", "LOG", "--number", "10"],
        ["list", "LOG", "--time", "3"],
        ["list", "LOG", "--repair"],
        ["undo", "LOG", "--time", "3"],
        ["undo", "LOG", "--number", "1", "--source", "human"],
        ["redo", "LOG", "--number", "1", "--run", "0"],
        ["redo", "LOG", "-o", "x"],
        ["explain", "LOG", "--number", "1", "--source", "human"],
        ["explain", "LOG", "--number", "1", "--run", "7"],
        ["explain", "LOG", "--time", "1", "--to", "2"],
        ["merge", "LOG", "LOG", "-o", "x", "--number", "1"],
        ["check", "LOG", "--number", "1"],
        ["check", "LOG", "--source", "human"],
    ],
)
def test_what_makes_no_sense_changes_nothing_and_says_why(folder, capsys, words):
    before = (folder / LABELS).read_bytes()
    names = {"LOG": folder / LABELS, "NONE": folder / "none.lira"}
    try:
        status, said = lira(capsys, *(names.get(word, word) for word in words))
    except SystemExit as end:
        status, said = end.code, capsys.readouterr()
    assert status == 2
    assert said.err
    assert (folder / LABELS).read_bytes() == before


def test_a_network_cannot_tell_but_its_labels_are_taken_back_all_the_same(folder, capsys):
    (folder / NOVICE).unlink()
    status, said = lira(capsys, "undo", folder / LABELS)
    assert status == 0
    assert "one that goes on with it learns it anew" in said.out
    status, said = lira(capsys, "explain", folder / LABELS, "--number", "1")
    assert status == 2
