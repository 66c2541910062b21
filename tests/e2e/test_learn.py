"""The main job end to end on a short course of the user's own: `lira demo`, twice, with one seed."""

import re
from functools import partial

import pytest
from safetensors.numpy import load_file
from short_worlds import FEW_METRES

from lira.fusion.learning.trainer import ProcessTrainer
from lira.fusion.log.label_log import DemonstrationLog
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, ResultRecord, RunRecord, RunWriter, StepRecord, read_run
from lira.fusion.methods.presets import METHODS
from lira.fusion.teaching.session import Same, Session
from lira.fusion.teaching.teacher import SKILLED
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.twin import Twin
from lira.tools.launch.processes import ChildProcess, lira_command
from lira.tools.runs.build import build_method, teacher
from lira.tools.runs.course import lap

LAPS = 1
DEMO_S = 120.0


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    path = tmp_path_factory.mktemp("world") / "short.toml"
    path.write_text(FEW_METRES)
    return path


@pytest.fixture(scope="module")
def demos(world, tmp_path_factory):
    """Two demos at the same time, so that they get in each other's way."""
    folder = tmp_path_factory.mktemp("demos")
    words = ["demo", "--world", str(world), "--laps", str(LAPS), "--unseen", "1"]
    words += ["--method", "hold", "--layouts", "own", "--proof", "own", "--no-record", "--run"]
    runs = [folder / name for name in ("first", "second")]
    children = [ChildProcess(run.name, lira_command(*words, str(run)), folder / f"{run.name}.log") for run in runs]
    try:
        for child in children:
            assert child.wait(DEMO_S) in (0, 1), child.output()
    finally:
        for child in children:
            child.stop()
    return dict(zip(runs, children, strict=True))


def without_wall_clock(path):
    """A run record without what may differ: the time it took and the folder's name in the command."""
    text = re.sub(rb'"elapsed_s":[^,}]*', b"", path.read_bytes())
    return re.sub(rb'"command":"[^"]*"', b"", text)


def test_a_demo_ends_with_a_result_a_report_and_the_matching_exit_status(demos):
    for run, child in demos.items():
        records = list(read_run(run / "run.jsonl"))
        assert isinstance(records[0], RunRecord)
        assert records[0].world == "short"
        result = records[-1]
        assert isinstance(result, ResultRecord)
        assert 1 <= result.laps <= LAPS
        assert result.training_steps >= 1
        laps = [record for record in records if isinstance(record, LapRecord)]
        assert child.status() == (0 if result.converged and laps[-1].passed else 1)
        assert [record.phase for record in laps[:2]] == ["train", "prove"]
        assert laps[-1].phase == "unseen"
        page = (run / "report.html").read_text()
        assert "short" in page
        assert child.output().splitlines()[-1] == f"report: {run / 'report.html'}"


def test_one_seed_gives_one_run(demos):
    first, second = demos
    assert (first / "labels.lira").read_bytes() == (second / "labels.lira").read_bytes()
    weights = [{n: w.tobytes() for n, w in load_file(run / "novice.safetensors").items()} for run in (first, second)]
    assert weights[0] == weights[1]
    assert without_wall_clock(first / "run.jsonl") == without_wall_clock(second / "run.jsonl")


def test_in_process_gives_the_same_decisions_as_over_the_bus(demos, world, tmp_path):
    profile, floor = load_profile("thesis-sim"), load_world(str(world))
    twin = Twin(profile, floor, renderer="sketch")  # as the demo's
    robot = GovernedRobot(twin)
    robot.open()
    method = build_method(METHODS["hold"], profile, 0, partial(ProcessTrainer, adopt_after_s=profile.period_s))
    try:
        with RunWriter(tmp_path / "run.jsonl") as record, DemonstrationLog(tmp_path / "labels.lira", profile) as log:
            session = Session(robot, twin, Journal(keep=log.append, write=record.write), method)
            session.teach(Same([lap(profile, floor, 0)]), teacher(SKILLED, profile, floor, 0, 0), LAPS)
    finally:
        method.close()
        robot.close()

    def decisions(path):
        steps = [record for record in read_run(path) if isinstance(record, StepRecord)]
        return [(s.decision.driver, s.decision.executed, s.label) for s in steps if s.decision.phase != "unseen"]

    assert decisions(tmp_path / "run.jsonl") == decisions(next(iter(demos)) / "run.jsonl")
