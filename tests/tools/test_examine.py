"""`lira fusion --policy FILE --unseen N`: a policy drives a twin's layouts alone, and is told how each went."""

import uuid

import pytest
import torch
from short_trials import SHORT, write_world

from fusion.expert_files import shipped_path
from hal.profile import load_profile
from tools import cli
from tools.processes import ChildProcess, free_port, lira_command

CAMERA = str(shipped_path("camera", load_profile("thesis-sim")))


@pytest.fixture
def examine(tmp_path, capsys):
    """Let the camera expert drive two layouts of a world over the bus; return the exit status and what is printed."""

    def run(world):
        address = f"127.0.0.1:{free_port()}"
        name = f"t{uuid.uuid4().hex}"
        command = lira_command("twin", "--lockstep", "--name", name, "--listen", address, "--world", world)
        with ChildProcess("twin", command, tmp_path / "twin.log") as twin:
            twin.wait_ready("twin", 30.0)
            words = ["--name", name, "--connect", address, "--policy", CAMERA, "--layout", "6", "--unseen", "2"]
            status = cli.main(["fusion", *words])
        return status, capsys.readouterr().out.splitlines()

    threads = torch.get_num_threads()
    yield run
    torch.set_num_threads(threads)  # the verb sets it for its whole process


def test_each_layout_is_told(examine, tmp_path):
    path = tmp_path / "free.toml"
    path.write_text(SHORT.replace("y_m = 0.1", "y_m = 9.0"))
    status, lines = examine(str(path))
    assert status == 0
    assert [line.split()[:4] for line in lines] == [["unseen", "layout", str(k), "passed"] for k in (7, 8)]


def test_a_policy_that_hits_a_box_has_failed(examine, tmp_path):
    status, lines = examine(write_world(tmp_path))
    assert status == 1
    assert len(lines) == 2
    assert all("failed" in line and "collisions 1" in line for line in lines)
