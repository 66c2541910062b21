"""On a twin: a policy that drives layouts alone, and a scripted teacher; how each lap went is told."""

import uuid

import pytest
from short_trials import write_world
from short_worlds import FOR_TRIALS

from lira.fusion.experts.files import shipped_path
from lira.hal.profile import load_profile
from lira.tools import cli
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

CAMERA = str(shipped_path("camera", load_profile("thesis-sim")))


EXAM = ("drive", CAMERA, "--layout", "6", "--unseen", "2")


@pytest.fixture
def lira(tmp_path, capsys):
    """Run a verb on a twin in lockstep; return the exit status and what is printed."""

    def run(world, *words):
        address = f"127.0.0.1:{free_port()}"
        name = f"t{uuid.uuid4().hex}"
        command = lira_command(
            "twin", "--lockstep", "--renderer", "sketch", "--name", name, "--listen", address, "--world", world
        )
        with ChildProcess("twin", command, tmp_path / "twin.log") as twin:
            twin.wait_ready("twin", 30.0)
            status = cli.main([*words, "--name", name, "--connect", address])
        return status, capsys.readouterr().out.splitlines()

    return run


def test_each_layout_is_told(lira, tmp_path):
    path = tmp_path / "free.toml"
    path.write_text(FOR_TRIALS.replace("y_m = 0.1", "y_m = 9.0"))
    status, lines = lira(str(path), *EXAM)
    assert status == 0
    assert "drives layouts 7 to 8 of " in lines[0]
    assert [line.split()[:4] for line in lines[1:]] == [["unseen", "layout", str(k), "passed"] for k in (7, 8)]


def test_a_policy_that_hits_a_box_has_failed(lira, tmp_path):
    status, (_, *lines) = lira(write_world(tmp_path), *EXAM)
    assert status == 1
    assert len(lines) == 2
    assert all("failed" in line and "collisions 1" in line for line in lines)


def test_behind_a_shield_it_hits_none_and_how_often_that_was_so_is_told(lira, tmp_path):
    _, (_, *lines) = lira(write_world(tmp_path), *EXAM, "--shield")
    assert len(lines) == 2
    assert all("collisions 0" in line and "turns changed by the shield" in line for line in lines)


def test_a_scripted_lesson_is_told_lap_by_lap(lira, tmp_path):
    words = (
        "--method",
        "hg-dagger-kernel",
        "--teacher",
        "perfect",
        "--train-laps",
        "1",
        "--run",
        str(tmp_path / "run"),
    )
    _, lines = lira(write_world(tmp_path), "fusion", *words)
    assert lines[0].startswith("hg-dagger (hg-dagger-kernel) on ")
    assert [line.split()[0] for line in lines[1:3]] == ["training", "proving"]
    assert any(line.startswith("saved ") and "the novice after" in line for line in lines)
    assert "1 training lap: the novice alone" in lines[-1]
