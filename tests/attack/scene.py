"""A robot and its peers, each in a process of its own, and what the robot's wheels were told."""

import signal
import sys
import time
import uuid
from contextlib import ExitStack
from pathlib import Path

from lira.tools.launch.processes import ChildProcess, free_port

HERE = Path(__file__).parent
READY_S = 60.0
BUDGET_S = 0.35  # within which the wheels stop


class Scene:
    """Leaving its `with` block stops all."""

    def __init__(self, kind, folder):
        self.name, self.endpoint = f"t{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}"
        self.far_port = free_port()
        self._folder = folder
        self._stack = ExitStack()
        self._count = 0
        self._log = folder / "wheels.txt"
        self._words = ["victim.py", kind, self.name, self.endpoint, str(self._log), str(self.far_port)]

    def __enter__(self):
        self.robot = self._start(self._words, "serves")
        return self

    def __exit__(self, *error):
        self._stack.close()

    def driver(self):
        """Start a driver; returns its process and the file with the times of its commands."""
        log = self._folder / f"driver{self._count}.txt"
        return self._start(["peer.py", "drive", self.name, self.endpoint, str(log)], "drives"), log

    def attackers(self, attacks):
        """Start one for each, side by side: connected, they wait until they may `begin`."""
        peers = [["peer.py", how, self.name, self.endpoint, str(size), *keys] for how, size, keys in attacks]
        started = [self._launch(words) for words in peers]
        for child in started:
            child.wait_ready("waits", READY_S)
        return started

    def _start(self, words, ready):
        child = self._launch(words)
        child.wait_ready(ready, READY_S)
        return child

    def _launch(self, words):
        self._count += 1
        log = self._folder / f"process{self._count}.log"
        return self._stack.enter_context(
            ChildProcess(words[1], [sys.executable, str(HERE / words[0]), *words[1:]], log)
        )

    def orders(self):
        """What the base was told: [(seconds, m/s)]."""
        lines = self._log.read_text().splitlines()[:-1]  # the last one may not be whole
        return [(float(at), float(linear)) for at, linear, _ in map(str.split, lines)]

    def moves(self):
        return self.orders()[-1:] != [] and self.orders()[-1][1] != 0.0

    def wait(self, condition, timeout_s):
        """Whether it came true in time."""
        until_s = time.monotonic() + timeout_s
        while time.monotonic() < until_s and not (done := condition()):
            time.sleep(0.05)
        return done

    def memory_mb(self):
        """The most that the robot's process ever had in memory."""
        status = Path(f"/proc/{self.robot.pid}/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) / 1024


def begin(attacker):
    attacker.signal(signal.SIGUSR1)


def kill(process):
    process.signal(signal.SIGKILL)
    process.wait(5.0)


def moved_on_s(orders, commands):
    """How long after the last of the driver's commands the base was told to stand; no order moves it later."""
    last_command_s = float(commands.read_text().split()[-1])
    moving = [at for at, linear in orders if linear != 0.0]
    zero = next(at for at, linear in orders if at > moving[-1] and linear == 0.0)
    return zero - last_command_s
