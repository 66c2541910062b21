"""The doors from the command line: one's own expert, method, robot and experiment, and whose fault it is."""

import sys
import textwrap
import uuid

import pytest
from short_trials import write_world

import lira
from lira.hal.messages import STOP, Command, Twist
from lira.tools import cli
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

LAB = """
import lira

def wall(seen):
    return 1.0, 0.8 if seen.scan[:50].min() < 0.4 else 0.0

def crash(seen):
    return 1.0, 1 / 0

class Gated(lira.Method):
    '''The third expert drives, the human teaches.'''
    def __init__(self, context):
        self.experts = context.experts
        self.novice = context.novice(trunks="scratch", m=10)

    def propose(self, features):
        view = self.experts[-1]
        return lira.Proposal(features, lira.Choice(view.name, view.act(features)), self.novice.act(features))

class Rover:
    '''A robot that goes as told and senses nothing.'''
    def __init__(self, profile):
        from lira.hal.testing import NullRobot
        import time
        self.robot = NullRobot(profile, time.monotonic, time.sleep)
    def __getattr__(self, name):
        return getattr(self.robot, name)

class Faulty(Rover):
    def read(self):
        raise RuntimeError("no reading")

class Brick:
    def __init__(self, profile):
        self.profile = profile
"""


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A working directory with a user's own module in it."""
    (tmp_path / "doorlab.py").write_text(LAB)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield tmp_path
    sys.modules.pop("doorlab", None)


@pytest.fixture
def lira_on_twin(lab, capsys):
    """Run a verb on a twin in lockstep; return the exit status, what is printed and what is complained of."""

    def run(*words):
        address, name = f"127.0.0.1:{free_port()}", f"t{uuid.uuid4().hex}"
        drawn = ("--lockstep", "--renderer", "sketch", "--world", write_world(lab))
        command = lira_command("twin", *drawn, "--name", name, "--listen", address)
        with ChildProcess("twin", command, lab / "twin.log") as twin:
            twin.wait_ready("serves world", 60.0)
            status = cli.main([*words, "--name", name, "--connect", address])
        return status, *capsys.readouterr()

    return run


def test_a_method_and_an_expert_of_ones_own_are_taught_over_the_bus(lira_on_twin, lab):
    words = (
        "fusion",
        "--method",
        "doorlab:Gated",
        "--expert",
        "doorlab:wall",
        "--train-laps",
        "1",
        "--run",
        str(lab / "run"),
    )
    status, out, err = lira_on_twin(*words, "--teacher", "perfect")
    assert err == ""
    assert status in (0, 1)  # one lap may be too few
    assert out.startswith("doorlab:Gated (doorlab:Gated) on short")
    steps = [each for each in lira.read_run(lab / "run" / "run.jsonl") if hasattr(each, "decision")]
    drivers = {step.decision.driver for step in steps if step.decision.phase == "train"}
    assert "wall" in drivers
    assert steps[-1].decision.training_steps > 0 or "there is no novice yet" in out


def test_a_policy_of_ones_own_drives_and_its_fault_is_its_own(lira_on_twin, lab):
    status, _, err = lira_on_twin("drive", "doorlab:crash", "--unseen", "1")
    assert status == 2
    what, remedy = err.splitlines()
    assert what == "lira drive: the policy 'doorlab:crash' failed: ZeroDivisionError: division by zero"
    assert remedy == f"  Mend it there: {lab / 'doorlab.py'}, line 8, in crash: return 1.0, 1 / 0"


def test_a_robot_of_ones_own_is_served_and_driven(lab):
    address, name = f"127.0.0.1:{free_port()}", f"t{uuid.uuid4().hex}"
    words = ("--driver", "doorlab:Rover", "--profile", "thesis-sim", "--name", name, "--listen", address)
    with ChildProcess("rover", lira_command("robot", *words), lab / "rover.log") as rover:
        rover.wait_ready("serves (thesis-sim)", 60.0)
        with lira.connect(address, name) as robot:
            robot.drive(Command(STOP, robot.now()))
            began_s = robot.now()
            while (odom := robot.read().odom) is None or odom.x_m < 0.05:
                assert robot.now() < began_s + 20.0
                robot.drive(Command(Twist(0.4, 0.0), robot.now(), answers=robot.read().seq))
                robot.wait(robot.now() + 0.1)


def test_the_fault_of_a_robot_of_ones_own_stops_it_and_is_its_own(lab, capsys):
    name, address = f"t{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}"
    words = ("--driver", "doorlab:Faulty", "--profile", "thesis-sim", "--name", name, "--listen", address)
    what, remedy = refused(capsys, "robot", *words)
    assert what == "lira robot: the robot 'doorlab:Faulty' failed: RuntimeError: no reading"
    assert 'in read: raise RuntimeError("no reading")' in remedy


def refused(capsys, *words):
    assert cli.main(list(words)) == 2
    what, remedy = capsys.readouterr().err.splitlines()
    return what, remedy


def test_a_robot_that_is_none_is_refused(lab, capsys):
    what, remedy = refused(capsys, "robot", "--driver", "doorlab:Brick")
    assert what == "lira robot: the robot 'doorlab:Brick' has no open, read, drive, now, wait, close"
    assert "profile, open, read" in remedy
    what, _ = refused(capsys, "robot", "--driver", "doorlab:Rover", "--base", "/dev/ttyS1")
    assert "--base is the ROSbot's" in what
    what, remedy = refused(capsys, "robot")
    assert (what, "--driver" in remedy) == ("lira robot: no --base", True)


@pytest.mark.parametrize("verb", ["fusion", "demo"])
def test_a_method_that_does_not_load_is_refused_before_anything_starts(lab, capsys, verb):
    what, _ = refused(capsys, verb, "--method", "doorlab:Gatd")
    assert what == f"lira {verb}: doorlab has no 'Gatd', which is to be the method 'doorlab:Gatd'"


def test_the_demo_refuses_an_expert_that_is_not_there(lab, capsys):
    what, remedy = refused(capsys, "demo", "--expert", "doorlab.deep:wall")
    assert what == "lira demo: there is no module 'doorlab.deep' with the policy 'doorlab.deep:wall'"
    assert str(lab) in remedy


OWN = """
    from short_trials import short_trial
    from lira.tools.experiments.experiment import Experiment, Table
    from lira.tools.experiments.effort.measures import label_row, method_rows

    mine = Experiment(
        trials=lambda seeds: [short_trial({world!r}, seed=seed, name="mine") for seed in range(seeds)],
        tables=lambda outcomes: [Table("What it took", method_rows(outcomes, label_row))],
        findings=lambda outcomes: [],
        methods=("mine",),
        words="eight metres of line",
    )
"""


def test_an_experiment_and_a_method_of_ones_own_are_played_and_kept(lab, capsys):
    (lab / "doorlab_study.py").write_text(textwrap.dedent(OWN.format(world=write_world(lab))))
    words = ("doorlab_study:mine", "--seeds", "1", "--run", str(lab / "kept"), "--method", "doorlab:Gated")
    assert cli.main(["experiment", *words]) == 0
    said = capsys.readouterr()
    assert "doorlab:Gated" in said.out
    assert (lab / "kept" / "doorlab_study-mine.html").exists()
    assert cli.main(["experiment", *words]) == 0
    assert "short" not in capsys.readouterr().err  # nothing was played again
    (lab / "doorlab.py").write_text(LAB + "# changed\n")
    assert cli.main(["experiment", *words]) == 0
    assert "1 kept trial of other code" in capsys.readouterr().err


def test_an_experiment_that_is_none_is_refused(lab, capsys):
    what, _ = refused(capsys, "experiment", "doorlab:wall")
    assert what == "lira experiment: the experiment 'doorlab:wall' is a function"
    _, remedy = refused(capsys, "experiment", "tabel2")
    assert "table2" in remedy
