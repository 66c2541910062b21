"""A whole life: up, nothing moves; a person lets it go; kills; it comes back and stands; down, and nothing is left."""

import contextlib
import io
import json
import os
import signal
import subprocess
import time
import uuid
from pathlib import Path

import pytest

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED, OPERATOR
from lira.hal.messages import STOP, OperatorRequest, Request
from lira.hal.messages.ros.codec import encode
from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

TIMEOUT_S = 60.0
WATCH_S = 1.5  # longer than it takes from a command to a motion


def lira(*words, ok=(0,)):
    done = subprocess.run(lira_command(*words), check=False, capture_output=True, text=True, timeout=2 * TIMEOUT_S)
    assert done.returncode in ok, done.stdout + done.stderr
    return done.stdout


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


class Life:
    """One robot that is up, looked at from outside."""

    def __init__(self, name, endpoint):
        self.name = name
        self.bus = Bus(name, connect=endpoint)
        self.watch = Bus(name, connect=endpoint, watch=True)
        self._applied = self.watch.reader(APPLIED, 256)

    def status(self, ok=(0, 1)):
        """What the verb says, in this process: it is asked often."""
        with contextlib.redirect_stdout(io.StringIO()) as said:
            assert main(["status", "--name", self.name, "--json"]) in ok, said.getvalue()
        return json.loads(said.getvalue())

    def process(self, name):
        return next(process for process in self.status()["processes"] if process["name"] == name)

    def twists(self, for_s):
        """What the wheels get in that time."""
        self._applied.poll()
        ends_s, twists = time.monotonic() + for_s, []
        while time.monotonic() < ends_s:
            time.sleep(0.05)
            twists += [received.message.twist for received in self._applied.poll()]
        return twists

    def moves(self):
        return any(twist != STOP for twist in self.twists(0.3))

    def until(self, condition):
        ends_s = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < ends_s, self.status()
            time.sleep(0.05)

    def go_on(self):
        """Ask as a person does on a screen, until it moves: who has just come may not hear it yet."""
        ends_s = time.monotonic() + TIMEOUT_S
        while not self.moves():
            assert time.monotonic() < ends_s, self.status()
            self.bus.put_raw(OPERATOR, encode(OperatorRequest(Request.RESUME)))

    def kill(self, name):
        """Kill one, and wait until it runs again."""
        before = self.process(name)
        os.kill(before["pid"], signal.SIGKILL)
        self.until(lambda: self.process(name)["starts"] == before["starts"] + 1)
        self.until(lambda: self.process(name)["phase"] == "runs")
        assert self.process(name)["ended"] == "signal SIGKILL"

    def close(self):
        self.watch.close()
        self.bus.close()


@pytest.fixture
def words(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    name, endpoint = f"up_{uuid.uuid4().hex[:8]}", f"127.0.0.1:{free_port()}"
    yield ["--world", "line", "--policy", "camera-expert", "--name", name, "--listen", endpoint, "--without", "page"]
    lira("down", "--name", name)


def test_what_is_killed_comes_back_and_nothing_drives_until_a_person_says_so(words):
    name, endpoint = words[words.index("--name") + 1], words[words.index("--listen") + 1]
    said = lira("up", *words)
    assert said.splitlines()[-1] == f"up: twin in 'line' at {endpoint}"
    life = Life(name, endpoint)
    try:
        # Up, and it stands: who drives is paused, and has armed nothing.
        assert set(life.twists(WATCH_S)) == {STOP}
        life.until(lambda: "heard" in life.status())
        status = life.status(ok=(0,))
        assert [process["name"] for process in status["processes"]] == ["twin", "monitor", "recorder", "driver", "pad"]
        assert (status["heard"]["situation"], status["heard"]["governor"]) == ("paused", "disarmed")
        # A second `up` says so, and starts nothing.
        assert "already up:" in lira("up", *words)
        assert "as something else" in lira("up", "--name", name, "--world", "room", ok=(1,))
        assert life.status()["supervisor"] == status["supervisor"]

        life.go_on()
        # The driver is killed: it comes back, and the robot stands until a person says so again.
        life.kill("driver")
        assert set(life.twists(WATCH_S)) == {STOP}
        life.until(lambda: life.status()["heard"]["situation"] == "paused")
        assert life.status()["heard"]["governor"] == "stopped"
        life.go_on()
        # The robot is killed: it comes back disarmed, and who drove does not arm it.
        driver = life.process("driver")["pid"]
        life.kill("twin")
        life.until(lambda: life.twists(0.3))  # heard again
        assert set(life.twists(WATCH_S)) == {STOP}
        assert life.process("driver")["pid"] == driver
        assert list(Path("runs/drive-line/recording").glob("*.mcap"))
        # The monitor is killed: nobody notices but who asks.
        life.kill("monitor")
        life.until(lambda: "heard" in life.status())

        pids = [process["pid"] for process in life.status()["processes"]]
    finally:
        life.close()
    assert f"'{name}' is down" in lira("down", "--name", name)
    assert not any(map(is_running, pids))
    assert "nothing is up" in lira("status", "--name", name, ok=(1,))


@pytest.fixture
def robot(tmp_path, monkeypatch):
    """A robot that somebody else runs: its name, and where it listens."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    name, endpoint = f"up_{uuid.uuid4().hex[:8]}", f"127.0.0.1:{free_port()}"
    command = lira_command("twin", "--name", name, "--listen", endpoint)
    with ChildProcess("the robot", command, tmp_path / "robot.log") as child:
        child.wait_ready("serves", TIMEOUT_S)
        yield name, endpoint


def test_beside_a_robot_that_is_there_no_twin_is_started_and_the_robot_stays(robot):
    name, endpoint = robot
    words = ["--name", name, "--set", "look", "--without", "page", "--without", "pad"]
    assert f"up: robot at {endpoint}" in lira("up", "--robot", endpoint, *words)
    try:
        status = json.loads(lira("status", "--name", name, "--json", ok=(0, 1)))
        assert [process["name"] for process in status["processes"]] == ["monitor"]
    finally:
        lira("down", "--name", name)
    lira("up", "--robot", endpoint, *words)  # it answers still
    lira("down", "--name", name)


def test_who_stays_takes_it_down_at_the_end(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    name = f"up_{uuid.uuid4().hex[:8]}"
    words = ["--name", name, "--listen", f"127.0.0.1:{free_port()}", "--set", "look", "--without", "page"]
    command = lira_command("up", *words, "--without", "pad", "--stay")
    with ChildProcess("up", command, tmp_path / "up.log") as child:
        child.wait_ready("monitor: monitor hears", TIMEOUT_S)
        assert "twin: twin" in child.output()
        child.signal(signal.SIGTERM)
        assert child.wait(TIMEOUT_S) == 0
        assert child.output().splitlines()[-2:] == ["monitor stopped", "twin stopped"]
    assert "nothing is up" in lira("status", "--name", name, ok=(1,))


def test_a_robot_that_is_not_there_is_said_and_nothing_stays_up(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    name = f"up_{uuid.uuid4().hex[:8]}"
    words = ["up", "--name", name, "--robot", f"127.0.0.1:{free_port()}", "--set", "look", "--without", "pad"]
    done = subprocess.run(lira_command(*words), check=False, capture_output=True, text=True, timeout=2 * TIMEOUT_S)
    assert done.returncode == 2
    assert "before it was ready" in done.stderr
    assert f"no robot named '{name}' answers" in done.stderr
    assert "nothing is up" in lira("status", "--name", name, ok=(1,))
