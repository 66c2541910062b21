"""The main job through the robot's drivers, on a very short course: emulated devices, `lira robot`, the learner."""

import pytest
from short_worlds import FEWER_METRES

from lira.fusion.log.run_log import LapRecord, ResultRecord, StepRecord, read_run
from lira.tools.launch.processes import ChildProcess, lira_command

DEMO_S = 150.0


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """One training lap and its proving run: 12 s of driving in real time."""
    folder = tmp_path_factory.mktemp("demo")
    (folder / "few.toml").write_text(FEWER_METRES)
    words = ["demo", "--wire", "--world", str(folder / "few.toml"), "--laps", "1", "--unseen", "0"]
    words += ["--method", "plus", "--layouts", "own", "--proof", "own", "--no-record"]
    run = folder / "run"
    with ChildProcess("demo", lira_command(*words, "--run", str(run)), folder / "demo.log") as child:
        status = child.wait(DEMO_S)
        assert status in (0, 1), child.output()
        return status, run, child.output()


def test_it_ends_as_its_proving_run_ended(demo):
    status, run, output = demo
    records = list(read_run(run / "run.jsonl"))
    train, prove = (record for record in records if isinstance(record, LapRecord))
    result = records[-1]
    assert isinstance(result, ResultRecord)
    assert (train.phase, prove.phase) == ("train", "prove")
    assert status == (0 if prove.passed else 1)
    assert result.converged is prove.passed
    assert result.training_steps >= 1
    assert output.splitlines()[-1] == f"report: {run / 'report.html'}"


def test_the_teacher_and_what_it_taught_drove_the_course_through_the_wire(demo):
    _, run, output = demo
    steps = [record for record in read_run(run / "run.jsonl") if isinstance(record, StepRecord)]
    training = [step for step in steps if step.decision.phase == "train"]
    assert training[-1].state.progress_m > 4.0
    drivers = {step.decision.driver for step in training}
    assert "human" in drivers
    assert drivers - {"human", "none"}
    # It moved for most of the time: devices and commands kept up. A busy machine may hold it up now and then.
    assert sum(step.decision.driver == "none" for step in steps) < 0.5 * len(steps)
    assert "serves (thesis-sim)" in output
    assert not list((run / "wire").iterdir())
