"""The supervisor with stand-ins for the robot and the others: real processes, real kills."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from lira.hal.errors import LiraError
from lira.tools.launch.processes import ChildProcess
from lira.tools.lifecycle import restart, supervisor, table
from lira.tools.lifecycle.control import bring_up, take_down
from lira.tools.lifecycle.folder import StateFolder
from lira.tools.lifecycle.records import STATE, State
from lira.tools.lifecycle.restart import Phase
from lira.tools.lifecycle.setup import Setup
from lira.tools.lifecycle.supervisor import Supervisor
from lira.tools.lifecycle.table import Process

TIMEOUT_S = 30.0
# A process that says that it is ready and lives; its life ends at a word in a file, or it hangs.
WELL = """
import pathlib, sys, time
from lira.tools.launch.notify import Notifier
notifier = Notifier.from_environment()
print("begins", flush=True)
notifier.ready("it works")
while not pathlib.Path(sys.argv[1]).exists():
    notifier.alive()
    time.sleep(0.02)
if pathlib.Path(sys.argv[1]).read_text() == "hang":
    time.sleep(60.0)
"""
NEVER_READY = "import time; time.sleep(60.0)"
FAILS = "print('no such camera'); raise SystemExit(3)"


def stand_in(name, code, word="", **words):
    return Process(name, f"the {name}", lambda _: ["-c", code, word], **words)


class Bed:
    """A supervisor over rows of its own, which runs until a condition holds."""

    def __init__(self, tmp_path, *processes):
        self.folder, self.said = StateFolder("rosbot"), []
        self.folder.make()
        self.setup = Setup(processes=tuple(process.name for process in processes))
        self.supervisor = Supervisor(self.setup, self.folder, self.said.append)

    def until(self, condition):
        bed, ends_s = self, time.monotonic() + TIMEOUT_S

        class Until:
            def is_set(self):
                assert time.monotonic() < ends_s, (bed.said, bed.states)
                return condition()

        self.supervisor.run(Until())

    @property
    def states(self):
        state = self.folder.read(STATE, State)
        return {} if state is None else {process.name: process for process in state.processes}

    def runs(self, *names):
        return all(name in self.states and self.states[name].phase is Phase.RUNS for name in names)


@pytest.fixture
def bed(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(restart, "FIRST_S", 0.2)

    def make(*processes):
        # The command of a row is Python's own words here, not those of `lira`.
        plain = [replace(row, words=row.words) for row in processes]
        monkeypatch.setattr(Process, "command", lambda row, setup: [sys.executable, *row.words(setup)])
        monkeypatch.setattr(table, "PROCESSES", tuple(plain))
        return Bed(tmp_path, *processes)

    return make


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for(condition):
    ends_s = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < ends_s
        time.sleep(0.02)


def test_the_robot_comes_first_and_the_rest_waits_until_it_is_ready(bed, tmp_path):
    gate = tmp_path / "gate"
    code = f"import pathlib, time\nwhile not pathlib.Path({str(gate)!r}).exists(): time.sleep(0.02)\n{WELL}"
    there = bed(stand_in("page", WELL, "never"), stand_in("robot", code, "never", is_robot=True))
    with there.supervisor:
        there.until(lambda: "robot" in there.states and there.states["robot"].phase is Phase.STARTS)
        assert (there.states["page"].phase, there.states["page"].pid) == (Phase.WAITS, None)
        gate.touch()
        there.until(lambda: there.runs("robot", "page"))
        assert there.states["page"].says == "it works"
        assert there.folder.read(STATE, State).runs


def test_one_that_is_killed_comes_back_after_a_pause_and_the_others_are_left_alone(bed):
    there = bed(stand_in("robot", WELL, "never", is_robot=True), stand_in("learner", WELL, "never"))
    with there.supervisor:
        there.until(lambda: there.runs("robot", "learner"))
        robot, learner = there.states["robot"].pid, there.states["learner"].pid
        os.kill(learner, signal.SIGKILL)
        there.until(lambda: not there.runs("learner"))
        assert there.states["learner"].ended == "signal SIGKILL"
        there.until(lambda: there.runs("learner"))
        again = there.states["learner"]
        assert again.pid != learner
        assert again.starts == 2
        assert there.states["robot"].pid == robot
        assert "learner ended with signal SIGKILL; it is started again in 0.2 s" in there.said
    assert there.folder.log("learner").read_text().startswith("begins\nbegins\n")


def test_a_robot_that_dies_comes_back_and_who_has_seen_it_is_not_started_anew(bed):
    there = bed(stand_in("robot", WELL, "never", is_robot=True), stand_in("learner", WELL, "never"))
    with there.supervisor:
        there.until(lambda: there.runs("robot", "learner"))
        learner = there.states["learner"].pid
        os.kill(there.states["robot"].pid, signal.SIGSEGV)
        there.until(lambda: there.states["robot"].starts == 2 and there.runs("robot"))
        assert there.states["learner"].pid == learner


def test_one_that_ends_by_itself_comes_back_too_and_waits_longer_each_time(bed, tmp_path):
    word = tmp_path / "word"
    word.write_text("end")
    there = bed(stand_in("learner", WELL, str(word)))
    with there.supervisor:
        there.until(lambda: "learner" in there.states and there.states["learner"].starts == 3)
    assert [words for words in there.said if "ended" in words][:2] == [
        f"learner ended with status 0; it is started again in {pause_s} s" for pause_s in ("0.2", "0.4")
    ]


def test_one_that_hangs_is_killed_and_comes_back(bed, tmp_path):
    word = tmp_path / "word"
    there = bed(stand_in("learner", WELL, str(word), patience_s=0.5))
    with there.supervisor:
        there.until(lambda: there.runs("learner"))
        word.write_text("hang")
        there.until(lambda: there.states["learner"].ended != "")
        word.unlink()
        there.until(lambda: there.states["learner"].starts >= 2 and there.runs("learner"))
    assert "learner gives no sign of life: it is killed" in there.said


def test_one_that_never_gets_ready_is_killed(bed, monkeypatch):
    monkeypatch.setattr(restart, "READY_S", 0.3)
    there = bed(stand_in("learner", NEVER_READY))
    with there.supervisor:
        there.until(lambda: "learner" in there.states and there.states["learner"].ended == "signal SIGKILL")


def test_in_the_end_the_robot_is_stopped_last_and_nothing_is_left(bed, tmp_path):
    there = bed(stand_in("robot", WELL, "never", is_robot=True), stand_in("learner", WELL, "never"))
    with there.supervisor:
        there.until(lambda: there.runs("robot", "learner"))
        pids = [process.pid for process in there.states.values()]
    assert there.said == ["robot: it works", "learner: it works", "learner stopped", "robot stopped"]
    assert {process.phase for process in there.states.values()} == {Phase.STOPPED}
    assert not any(map(is_running, pids))


def test_a_log_does_not_grow_without_end(bed, tmp_path, monkeypatch):
    monkeypatch.setattr(supervisor, "MOST_LOG_BYTES", 10_000)
    code = WELL.replace("    notifier.alive()", "    notifier.alive(); print('x' * 200, flush=True)")
    there = bed(stand_in("learner", code, "never"))
    older = there.folder.logs / "learner.log.1"
    with there.supervisor:
        there.until(lambda: older.exists() and there.folder.log("learner").stat().st_size > 1000)
        assert there.folder.log("learner").stat().st_size < 20_000
        assert older.stat().st_size < 20_000


def test_one_that_cannot_be_stopped_keeps_none_of_the_others_up(bed, monkeypatch):
    there = bed(stand_in("robot", WELL, "never", is_robot=True), stand_in("learner", WELL, "never"))
    there.until(lambda: there.runs("robot", "learner"))
    robot, learner = there.states["robot"].pid, there.states["learner"].pid
    really = ChildProcess.stop

    def stubborn(child):
        status = really(child)
        if child.pid == learner:
            raise LiraError("cannot be killed")
        return status

    monkeypatch.setattr(ChildProcess, "stop", stubborn)
    with pytest.raises(LiraError, match="cannot be killed"), there.supervisor:
        pass
    assert not is_running(robot)


def test_a_disk_that_takes_no_state_stops_nobody(bed, monkeypatch):
    there = bed(stand_in("learner", WELL, "never"))

    def full(file, value):
        raise LiraError("the disk is full")

    monkeypatch.setattr(there.folder, "write", full)
    with there.supervisor:
        there.until(lambda: "the disk is full" in there.said)


# From outside: a real supervisor's process over stand-ins

OUTSIDE = """
import sys
from lira.tools.lifecycle import table
from lira.tools.lifecycle.table import Process
def stand_in(name, code, word="", **words):
    return Process(name, f"the {name}", lambda _: ["-c", code, word], **words)
Process.command = lambda row, setup: [sys.executable, *row.words(setup)]
"""


@pytest.fixture
def outside(tmp_path, monkeypatch):
    """Has the supervisor's process, which is another one, find stand-ins in the list."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.setenv("PYTHONPATH", str(site))

    def make(**codes):
        rows = [f"stand_in({name!r}, {code!r}, 'never', is_robot={name == 'robot'})" for name, code in codes.items()]
        text = f"{OUTSIDE}\ntable.PROCESSES = ({', '.join(rows)},)\n"
        # Only the supervisor takes it: what it starts are stand-ins.
        guard = "if 'lira.tools.lifecycle' in sys.orig_argv:"
        body = "\n".join(f"    {line}" for line in text.splitlines())
        (site / "sitecustomize.py").write_text(f"import sys\n{guard}\n{body}\n")
        return Setup(processes=tuple(codes))

    return make


def test_up_tells_what_is_ready_and_down_ends_it(outside):
    setup, said = outside(robot=WELL, learner=WELL), []
    state = bring_up(setup, said.append)
    assert said == ["robot: it works", "learner: it works"]
    folder = StateFolder("rosbot")
    assert folder.supervisor() == state.pid
    with pytest.raises(LiraError, match="up already"):
        bring_up(setup, said.append)
    assert folder.supervisor() == state.pid
    said.clear()
    assert take_down("rosbot", said.append)
    assert said == ["learner stopped", "robot stopped"]
    assert not any(is_running(process.pid) for process in state.processes)
    assert not take_down("rosbot", said.append)


def test_what_ends_before_it_is_ready_is_quoted_and_nothing_stays_up(outside):
    setup = outside(robot=WELL, learner=FAILS)
    with pytest.raises(LiraError, match=r"(?s)the learner ended with status 3 before it was ready.*no such camera"):
        bring_up(setup, lambda _: None)
    assert StateFolder("rosbot").supervisor() is None


def test_whoever_dies_by_a_kill_of_the_supervisor_leaves_nothing_behind(outside):
    setup = outside(robot=WELL, learner=WELL)
    state = bring_up(setup, lambda _: None)
    os.kill(state.pid, signal.SIGKILL)
    wait_for(lambda: not any(is_running(process.pid) for process in state.processes))
    assert StateFolder("rosbot").supervisor() is None
    again = bring_up(setup, lambda _: None)
    assert again.pid != state.pid
    assert take_down("rosbot", lambda _: None)


def test_the_supervisor_outlives_who_started_it(outside, tmp_path):
    setup = outside(robot=WELL)
    code = "import sys, msgspec\nfrom lira.tools.lifecycle.control import bring_up\n"
    code += "from lira.tools.lifecycle.setup import Setup\n"
    code += f"bring_up(Setup(processes={setup.processes!r}), print)\n"
    subprocess.run([sys.executable, "-W", "ignore", "-c", code], check=True, timeout=TIMEOUT_S)
    folder = StateFolder("rosbot")
    assert folder.supervisor() is not None
    assert take_down("rosbot", lambda _: None)
