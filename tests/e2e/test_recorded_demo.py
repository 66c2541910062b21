"""A demo is recorded by itself, explained from its recording, and comes out the same when it is gone through again."""

import json

import pytest
from short_worlds import FEW_METRES

from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, lira_command

DEMO_S = 150.0


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    (folder / "few.toml").write_text(FEW_METRES)
    words = ["demo", "--world", str(folder / "few.toml"), "--laps", "1", "--unseen", "1"]
    with ChildProcess("demo", lira_command(*words, "--run", str(folder / "run")), folder / "demo.log") as child:
        assert child.wait(DEMO_S) in (0, 1), child.output()
    return folder / "run"


def told(capsys, *words):
    assert main([str(word) for word in words]) == 0
    return capsys.readouterr().out


def test_nothing_of_it_is_missing(run, tmp_path, capsys):
    told(capsys, "info", run, "--json", tmp_path / "info.json")
    found = json.loads((tmp_path / "info.json").read_text())
    assert (found["mode"], found["torn"], found["lost"]) == ("lockstep", [], {})
    assert found["topics"]["lira/method"]["missing"] == found["topics"]["lira/decision"]["missing"] == 0
    decisions = (run / "run.jsonl").read_text().count('"type":"step"')
    assert found["topics"]["lira/decision"]["count"] == decisions
    # Each was made on a picture and a scan, which are all there.
    assert found["topics"]["scan"]["count"] >= decisions
    assert found["topics"]["camera/color/image_raw/compressed"]["count"] >= decisions


def test_it_is_identical_when_it_is_gone_through_again(run, capsys):
    assert told(capsys, "rerun", run).startswith("identical: ")


def test_its_last_call_is_explained(run, capsys):
    out = told(capsys, "explain", run, "--last-call")
    assert "because" in out
    assert "wheels" in out


def test_with_another_threshold_there_is_a_table(run, capsys):
    assert "calls for attention" in told(capsys, "rerun", run, "--set", "theta=0.06")
