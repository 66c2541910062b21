"""`lira train-expert` on a curriculum that takes seconds: the shipped experts show that the real ones are passed."""

import pytest

from lira.fusion.experts.files import EXPERTS, experts_of
from lira.fusion.experts.tasks import TASKS
from lira.fusion.inference.checkpoint import load_checkpoint
from lira.fusion.teaching.curriculum import CURRICULA, STRICT, Curriculum, curriculum
from lira.fusion.teaching.ride import Drive
from lira.hal.errors import ConfigError
from lira.hal.messages import Episode
from lira.hal.profile import load_profile
from lira.tools import cli


@pytest.fixture
def short(monkeypatch):
    """Set a curriculum of one drive along a straight line."""

    def install(limit_s, goal="stay", **proof):
        drives = (Drive(Episode(), limit_s, goal),)
        short = Curriculum("straight", STRICT, drives, laps=2, **proof)
        monkeypatch.setitem(CURRICULA["line"], "camera", short)

    return install


def test_an_expert_that_passes_is_saved_with_its_cruise_and_how_it_was_made(short, tmp_path, capsys):
    short(8.0)
    path = tmp_path / "a folder" / "expert.safetensors"
    assert cli.main(["train-expert", "camera", "--seed", "3", "--out", str(path)]) == 0
    network, checkpoint = load_checkpoint(path)
    assert network.kind == checkpoint.kind == "camera"
    assert checkpoint.provenance == "lira train-expert camera --profile thesis-sim --seed 3"
    assert checkpoint.training_steps == checkpoint.labels // 30 > 0
    assert checkpoint.cruise[0] > 0.5
    assert abs(checkpoint.cruise[1]) < 0.5
    assert "camera expert: " in capsys.readouterr().out


def test_an_expert_that_fails_is_not_saved_and_the_old_one_stays(short, tmp_path, capsys):
    short(8.0, "finish")  # which is 50 m away
    path = tmp_path / "expert.safetensors"
    path.write_bytes(b"the old one")
    assert cli.main(["train-expert", "camera", "--out", str(path)]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "lira train-expert: after 2 laps the camera expert of 'line' does not pass the lap that was taught; "
        "nothing was saved",
        "  Try another seed.",
    ]
    assert path.read_bytes() == b"the old one"


def test_one_that_is_to_be_proven_anew_says_what_it_could_not_do(short, tmp_path, capsys):
    short(8.0, "finish", proofs=3, mirrored=True, labels_per_step=10)
    assert cli.main(["train-expert", "camera", "--out", str(tmp_path / "expert.safetensors")]) == 2
    assert "after 2 laps the camera expert of 'line' does not pass 3 fresh laps in a row" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_one_that_passes_fresh_laps_is_proven_by_each_of_them(short, tmp_path, capsys):
    short(8.0, proofs=3, mirrored=True, labels_per_step=10)
    assert cli.main(["train-expert", "camera", "--out", str(tmp_path / "expert.safetensors")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[2] for line in lines if line.startswith("proving run")][-3:] == ["1.1", "1.2", "1.3"]


def test_a_place_that_cannot_be_written_is_named_before_the_training(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert cli.main(["train-expert", "lidar", "--out", str(tmp_path / "file" / "expert.safetensors")]) == 2
    assert "cannot write" in capsys.readouterr().err


def test_a_task_that_borrows_its_lidar_expert_trains_none(capsys):
    assert cli.main(["train-expert", "lidar", "--task", "corridor"]) == 2
    what, remedy = capsys.readouterr().err.splitlines()
    assert "uses that of 'garden'" in what
    assert "--task garden" in remedy


@pytest.mark.parametrize("words", [["depth"], ["depth", "--task", "line"], ["depth", "--task", "eight"]])
def test_a_task_without_an_expert_of_that_sensor_names_those_that_have_one(words, capsys):
    assert cli.main(["train-expert", *words]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"lira train-expert: the task '{words[-1] if words[1:] else 'line'}' has no depth expert",
        "  Train one with --task table-top.",
    ]


@pytest.mark.parametrize("kind", EXPERTS)
@pytest.mark.parametrize("task", TASKS.values(), ids=lambda task: task.name)
def test_whatever_a_robot_of_a_task_learns_from_has_a_curriculum_and_nothing_else_has(task, kind):
    if kind in experts_of(load_profile(task.profile)):
        assert curriculum(kind, task.name) is CURRICULA[task.owner(kind)][kind]
    else:
        with pytest.raises(ConfigError, match=f"'{task.name}' has no {kind} expert"):
            curriculum(kind, task.name)


def test_a_profile_that_does_not_learn_from_that_sensor_trains_none(capsys):
    assert cli.main(["train-expert", "depth", "--task", "table-top", "--profile", "thesis-sim"]) == 2
    what, remedy = capsys.readouterr().err.splitlines()
    assert "'thesis-sim' has no depth expert: it learns from " in what
    assert "--profile thesis-sim-depth" in remedy


@pytest.mark.parametrize("name", ["mine", "mine.onnx"])
def test_a_checkpoint_that_no_verb_would_know_by_its_name_is_refused_before_the_training(name, tmp_path, capsys):
    path = tmp_path / "there" / name
    assert cli.main(["train-expert", "camera", "--out", str(path)]) == 2
    what, remedy = capsys.readouterr().err.splitlines()
    assert what == f"lira train-expert: {path} is no .safetensors file"
    assert remedy == f"  Name the checkpoint {name}.safetensors."
    assert list(tmp_path.iterdir()) == []
