"""Hours in minutes: a twin and a driver over the bus, watched for memory, threads and files that only grow.

The driver drives all the time; now and then the robot is put back to its start. The first fifth is warm-up.
"""

import statistics
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from hal.bus import Bus
from hal.errors import ConfigError
from hal.messages import Episode
from hal.topics import RESET
from tools.bench import Row
from tools.processes import ChildProcess, free_port, lira_command
from tools.stop_test import driver
from tools.stop_test.control import say

MINUTES = 30.0
READY_S = 40.0
SAMPLE_S = 1.0
RESET_S = 20.0
WARM_UP = 0.2
FLAT_KB = 4096.0  # growth of the median from the first to the last third that still counts as flat


@dataclass(slots=True)
class Watched:
    """One process and what it used over time."""

    name: str
    process: ChildProcess
    rss_kb: list[int] = field(default_factory=list)
    threads: list[int] = field(default_factory=list)
    files: list[int] = field(default_factory=list)

    def sample(self) -> None:
        """Look once. Raises `ProcessError` if it has ended."""
        if self.process.status() is not None:
            raise self.process.failure()
        proc = Path(f"/proc/{self.process.pid}")
        status = dict(line.split(":", 1) for line in (proc / "status").read_text(encoding="utf-8").splitlines())
        self.rss_kb.append(int(status["VmRSS"].split()[0]))
        self.threads.append(int(status["Threads"]))
        self.files.append(sum(1 for _ in (proc / "fd").iterdir()))

    def row(self) -> Row:
        """Sum it up."""
        settled = slice(int(len(self.rss_kb) * WARM_UP), None)
        grown_kb = growth(self.rss_kb[settled])
        more_threads, more_files = growth(self.threads[settled]), growth(self.files[settled])
        return {
            "process": self.name,
            "samples": len(self.rss_kb),
            "rss_mb": self.rss_kb[-1] / 1024,
            "rss_growth_mb": grown_kb / 1024,
            "threads": self.threads[-1],
            "threads_growth": more_threads,
            "files": self.files[-1],
            "files_growth": more_files,
            "flat": grown_kb <= FLAT_KB and more_threads <= 0 and more_files <= 0,
        }


def growth(values: list[int]) -> float:
    """Median of the last third less that of the first."""
    third = max(len(values) // 3, 1)
    return statistics.median(values[-third:]) - statistics.median(values[:third])


def run(minutes: float = MINUTES) -> list[Row]:
    """Return a row for the robot and one for the driver. Raises `ConfigError` where there is no /proc."""
    if not Path("/proc/self/status").exists():
        raise ConfigError("this machine does not tell what a process uses", "Run the soak on Linux.")
    name, port, ear = f"soak_{free_port()}", free_port(), free_port()
    endpoint = f"127.0.0.1:{port}"
    with TemporaryDirectory() as folder, ExitStack() as stack:

        def start(what: str, command: list[str], ready: str) -> Watched:
            process = stack.enter_context(ChildProcess(what, command, Path(folder) / f"{what}.log"))
            process.wait_ready(ready, READY_S)
            return Watched(what, process)

        module = [sys.executable, "-P", "-m", "tools.stop_test.driver"]
        watched = [
            start("robot", lira_command("twin", "--name", name, "--listen", endpoint), "serves"),
            start("driver", [*module, name, endpoint, "policy", str(ear)], driver.READY),
        ]
        bus = Bus(name, connect=endpoint)
        stack.callback(bus.close)
        watch(watched, bus, ear, minutes * 60.0)
    return [one.row() for one in watched]


def watch(watched: list[Watched], bus: Bus, ear: int, duration_s: float) -> None:
    """Sample everything until the time is over."""
    began_s = reset_s = time.monotonic()
    while (now_s := time.monotonic()) < began_s + duration_s:
        if now_s >= reset_s:
            reset_s = now_s + RESET_S
            bus.ask(RESET, msgspec.json.encode(Episode()))
            say(ear, "go")
        for one in watched:
            one.sample()
        time.sleep(SAMPLE_S)
