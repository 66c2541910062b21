"""SIGINT and SIGTERM end every verb within seconds, without a traceback, whatever became of the robot meanwhile."""

import os
import re
import signal
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from ros2_peer import Peer

from lira.tools.launch.processes import ChildProcess, free_port, lira_command

pytestmark = pytest.mark.slow

OPEN = "open them with: lira robot"
READY_S = 90.0
END_S = 10.0  # 3 s are promised; the rest is for a busy machine
SIGNALS = (signal.SIGINT, signal.SIGTERM)
SETTLE_S = 0.5
WARM_S = 1.0
ROOM = ("--world", "room", "--profile", "rosbot2", "--renderer", "sketch")


class Stage:
    """Processes on a bus of their own, with their logs in a folder."""

    def __init__(self, folder, stack):
        self.folder, self._stack = folder, stack
        port = free_port()
        self.callback = stack.callback
        self.name, self.endpoint = f"ends_{port}", f"127.0.0.1:{port}"

    @property
    def connect(self):
        return ["--name", self.name, "--connect", self.endpoint]

    def start(self, name, *words, ready=None):
        process = ChildProcess(name, lira_command(*map(str, words)), self.folder / f"{name}.log")
        self._stack.enter_context(process)
        if ready is not None:
            self.line = process.wait_ready(ready, READY_S)
        return process

    def twin(self, *words):
        where = ["--name", self.name, "--listen", self.endpoint]
        return self.start("twin", "twin", "--world", "line", *where, *words, ready="serves")

    def devices(self):
        self.start("devices", "twin", *ROOM, "--wire", self.folder / "wire", ready=OPEN)
        return re.search(r"lira robot (.*)", self.line)[1].split()


@pytest.fixture
def stage(tmp_path, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    with ExitStack() as stack:
        yield Stage(tmp_path, stack)


def family(pid):
    """The processes that a process has started, and theirs."""
    tasks = Path(f"/proc/{pid}/task")
    own = [int(child) for task in tasks.glob("*/children") for child in task.read_text().split()]
    return own + [each for child in own for each in family(child)]


def runs(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def assert_ends(process, number):
    """Within time, by itself, without a traceback, and with all that it started."""
    own = family(process.pid)
    began_s = time.monotonic()
    process.signal(number)
    status = process.wait(20.0)
    took_s = time.monotonic() - began_s
    print(f"{process.name}: {status} after {took_s:.2f} s")
    assert status is not None, "it goes on"
    assert took_s < END_S, process.output()
    assert status >= 0, f"it died of {-status}"
    assert "Traceback" not in process.output(), process.output()
    while left := [pid for pid in own if runs(pid)]:
        assert time.monotonic() < began_s + END_S, f"it left processes behind: {left}"
        time.sleep(0.05)


def demo(stage):
    return stage.start("demo", "demo", "--run", stage.folder / "run", ready="serves")


def wired_demo(stage):
    return stage.start("demo", "demo", "--wire", "--no-record", "--run", stage.folder / "run", ready=OPEN)


def twin(stage):
    return stage.twin()


def twin_in_lockstep(stage):
    return stage.twin("--lockstep")


def wired_twin(stage):
    words = ["--wire", stage.folder / "wire", "--arena", stage.endpoint]
    return stage.start("twin", "twin", *ROOM, *words, ready=OPEN)


def robot(stage):
    return stage.start(
        "robot", "robot", *stage.devices(), "--name", stage.name, "--listen", stage.endpoint, ready="serves"
    )


def calibrate(stage):
    words = stage.devices()
    base, lidar = words[words.index("--base") + 1], words[words.index("--lidar") + 1]
    settings = stage.folder / "settings.toml"
    words = ["base", "--base", base, "--lidar", lidar, "--settings", settings, "--yes"]
    return stage.start("calibrate", "calibrate", *words, ready="slowly")


def taught(stage):
    stage.twin("--lockstep")
    words = ["--method", "plus", "--no-record", "--teacher", "scripted", "--run", stage.folder / "run"]
    process = stage.start("fusion", "fusion", *stage.connect, *words)
    wait_for((stage.folder / "run" / "run.jsonl").exists, process)
    return process


def training(stage):
    return warmed(stage.start("train", "train-expert", "lidar", "--out", stage.folder / "lidar.safetensors"))


def experiment(stage):
    return warmed(stage.start("experiment", "experiment", "race", "--seeds", "1", "--run", stage.folder / "run"))


def experiment_in_processes(stage):
    words = ["race", "--seeds", "2", "--workers", "2", "--run", stage.folder / "run"]
    return warmed(stage.start("experiment", "experiment", *words))


def warmed(process):
    """It says nothing before its first result."""
    time.sleep(WARM_S)
    assert process.status() is None, process.output()
    return process


def bench_latency(stage):
    return warmed(stage.start("bench", "bench", "latency"))


def parity(stage):
    return warmed(stage.start("parity", "parity", "--profile", "thesis-sim", ready="twin: ..."))


def stop_test(stage):
    return warmed(stage.start("stop-test", "stop-test", "--quick"))


def ros2(stage):
    port = free_port()
    peer = Peer(port)
    stage.callback(peer.close)
    words = ["--connect", f"127.0.0.1:{port}", "--name", stage.name, "--listen", stage.endpoint]
    return stage.start("ros2", "ros2", *words, ready="serves")


def wait_for(condition, process):
    deadline_s = time.monotonic() + READY_S
    while not condition():
        assert process.status() is None, process.output()
        assert time.monotonic() < deadline_s
        time.sleep(0.05)


ALONE = [demo, wired_demo, twin, twin_in_lockstep, wired_twin, robot, calibrate, taught, training, experiment,
         experiment_in_processes, bench_latency, parity, stop_test, ros2]  # fmt: skip


# Every verb by one of the signals; by both what serves. What starts others are two demos.
BY_BOTH = (twin,)
ENDED = [
    (verb, number) for k, verb in enumerate(ALONE) for number in (SIGNALS if verb in BY_BOTH else [SIGNALS[k % 2]])
]


@pytest.mark.parametrize(("verb", "number"), ENDED, ids=lambda value: getattr(value, "__name__", None))
def test_a_signal_ends_it(stage, verb, number):
    process = verb(stage)
    time.sleep(SETTLE_S)
    assert_ends(process, number)


CLIENTS = {
    "person": (["fusion", "--method", "plus", "--paused", "--no-record", "--run", "{folder}/run"], "learns on"),
    "policy": (["drive", "camera-expert"], "drives '"),
    "console": (["console"], "console shows"),
    "joystick": (["joystick"], "joystick waits for a pad"),
}


@pytest.mark.parametrize(("lot", "turn"), [("there", 0), ("killed", 1), ("frozen", 0)])
def test_a_signal_ends_a_client_whatever_became_of_its_robot(stage, lot, turn):
    robot, clients = stage.twin(), []
    for client, (words, _) in CLIENTS.items():
        clients.append(stage.start(client, *(word.format(folder=stage.folder) for word in words), *stage.connect))
    for process, (_, ready) in zip(clients, CLIENTS.values(), strict=True):
        process.wait_ready(ready, READY_S)
    time.sleep(SETTLE_S)
    if lot != "there":
        os.kill(robot.pid, signal.SIGKILL if lot == "killed" else signal.SIGSTOP)
        time.sleep(2.0)  # long enough for them to notice
    for k, process in enumerate(clients):
        assert_ends(process, SIGNALS[(k + turn) % 2])
    assert "saved 0 labels" in clients[0].output()
    robot.signal(signal.SIGKILL)  # one that is frozen hears of nothing else
