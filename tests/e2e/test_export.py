"""A run that was recorded over the bus, exported: what a learner saw and kept stands in the data set, to the bit."""

import contextlib
import signal
import uuid

import numpy as np
import pyarrow.parquet as pq
import pytest
from short_worlds import FEW_METRES

from lira.fusion.log.label_log import read_demonstrations
from lira.fusion.modalities.image import gray_image
from lira.hal.messages import Image
from lira.tools.cli import main
from lira.tools.export.columns import SCAN
from lira.tools.export.run import load_run
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

RUN_S = 120.0


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Folder of a run of one lap, recorded by `lira record`."""
    folder = tmp_path_factory.mktemp("export")
    (folder / "short.toml").write_text(FEW_METRES)
    endpoint = f"127.0.0.1:{free_port()}"
    robot = ["--name", f"x{uuid.uuid4().hex}"]
    at = [*robot, "--connect", endpoint]

    def start(stack, ready, verb, *words):
        child = ChildProcess(verb, lira_command(verb, *words), folder / f"{verb}.log")
        stack.enter_context(child).wait_ready(ready, 60.0)
        return child

    with contextlib.ExitStack() as stack:
        world = ["--world", str(folder / "short.toml"), "--renderer", "sketch", "--lockstep", "--listen", endpoint]
        start(stack, "serves world", "twin", *robot, *world)
        recorder = start(stack, "records", "record", *at, "--out", str(folder / "run/recording"))
        lesson = ["--method", "plus", "--teacher", "scripted", "--train-laps", "1"]
        fusion = ChildProcess(
            "fusion",
            lira_command("fusion", *at, *lesson, "--no-record", "--run", str(folder / "run")),
            folder / "fusion.log",
        )
        with fusion:
            assert fusion.wait(RUN_S) in (0, 1), fusion.output()
        recorder.signal(signal.SIGINT)
        assert recorder.wait(20.0) == 0, recorder.output()
    return folder / "run"


def test_what_the_learner_saw_is_in_the_data_set(run):
    found = load_run(run)
    labels = {(each.observation, each.source, each.novice): each for each in read_demonstrations(found.labels)}
    assert len(labels) > 20
    met = 0
    pictures = found.cameras["camera"].of(step for table in found.tables for step in table.episode.steps)
    for table in found.tables:
        for number, step in enumerate(table.episode.steps):
            picture = next(pictures)
            decision = step.decision
            label = labels.get((decision.observation, decision.driver, decision.novice))
            if label is None:
                assert not step.in_buffer
                continue
            met += 1
            assert step.in_buffer == label.stored
            assert (table[SCAN].values[number] == label.features.scan).all()
            assert (gray_image(Image(0.0, picture), label.features.image.shape[0]) == label.features.image).all()
    assert met > 0.95 * len(labels)  # decisions travel by a topic that may lose some


def test_rerun_gets_a_file_of_it(run, tmp_path):
    from rerun.chunk import RrdReader  # it takes a while

    file = tmp_path / "run.rrd"
    with ChildProcess("view", lira_command("view", str(run), "--rerun", str(file)), tmp_path / "view.log") as view:
        assert view.wait(60.0) == 0, view.output()
    paths = {chunk.entity_path for chunk in RrdReader(file).stream()}
    assert {"/world/scan", "/world/camera", "/who/drives", "/activation/experts/camera"} <= paths
    assert [path for path in paths if "visual_geometries/base_link" in path]


def test_the_data_set_goes_out_and_comes_back(run, tmp_path, capsys):
    assert main(["export", "lerobot", str(run), str(tmp_path / "set")]) == 0
    rows = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    kept = int(np.sum(rows["in_buffer"].to_pylist()))
    assert 0 < kept < len(rows)
    assert main(["import", str(tmp_path / "set"), "--run", str(tmp_path / "warm"), "--frames", "buffer"]) == 0
    assert f"{kept} labels (" in capsys.readouterr().out
    before = sorted(each.action for each in read_demonstrations(run / "labels.lira") if each.stored)
    after = sorted(each.action for each in read_demonstrations(tmp_path / "warm/labels.lira"))
    assert len(before) - len(after) <= 0.05 * len(before)
