"""Hours in minutes: a robot at work with all that belongs to it, watched for memory, threads and files that only grow.

`lira twin`, `lira fusion`, the bridge of `lira joystick` and the ears of `lira console` run as they do on a desk. Now
and then a hand takes control and gives it back, the emergency stop is pressed and released, the robot is put back to
its start, and somebody joins the bus and leaves. The first fifth is warm-up.
"""

import statistics
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import press_estop, release_estop
from lira.hal.bus.topics import APPLIED, RESET
from lira.hal.client.connect import on_bus
from lira.hal.errors import ConfigError
from lira.hal.messages import STOP, Episode, Source
from lira.tools.bench import Row
from lira.tools.bench.parts import watcher
from lira.tools.launch.processes import ChildProcess, free_port, lira_command
from lira.tools.stop_test.control import tell
from lira.tools.stop_test.parts import hand

MINUTES = 30.0
READY_S = 60.0
SAMPLE_S = 1.0
WARM_UP = 0.2
POINTS = 150  # of a line through the samples
FLAT_KB = 4096.0  # growth along that line that still counts as flat
AT_WORK = 0.5  # share of the samples in which policy moves the robot
# Seconds of a round: what happens then.
ROUND = {1: "reset", 2: "go", 6: "leave", 20: "press", 21: "release", 22: "go", 26: "leave", 35: "visit"}
ROUND_S = 40


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
        grown_kb = rise(self.rss_kb[settled])
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


@dataclass(slots=True)
class Work:
    """Whether the robot was at work, and for whom."""

    samples: int = 0
    moving: dict[Source, int] = field(default_factory=lambda: dict.fromkeys(Source, 0))

    def note(self, source: Source, *, moving: bool) -> None:
        """One look."""
        self.samples += 1
        self.moving[source] += moving

    def row(self) -> Row:
        """Sum it up: a soak in which nobody drives shows nothing."""
        policy, teleop = (self.moving[source] / max(self.samples, 1) for source in (Source.POLICY, Source.TELEOP))
        return {
            "process": "moved by policy, by hand",
            "samples": self.samples,
            "policy_share": policy,
            "hand_share": teleop,
            "flat": policy >= AT_WORK and teleop > 0.0,
        }


def rise(values: list[int]) -> float:
    """How much values grew along the line with the median slope of all pairs: single peaks do not bend it."""
    points = list(enumerate(values))[:: max(len(values) // POINTS, 1)]
    slopes = [(after - before) / (late - early) for (early, before), (late, after) in combinations(points, 2)]
    return statistics.median(slopes) * (len(values) - 1) if slopes else 0.0


def growth(values: list[int]) -> float:
    """Median of the last third less that of the first."""
    third = max(len(values) // 3, 1)
    return statistics.median(values[-third:]) - statistics.median(values[:third])


def run(minutes: float = MINUTES) -> list[Row]:
    """Return a row for each process, and whether they were at work. Raises `ConfigError` where there is no /proc."""
    if not Path("/proc/self/status").exists():
        raise ConfigError("this machine does not tell what a process uses", "Run the soak on Linux.")
    name, port, ear = f"soak_{free_port()}", free_port(), free_port()
    endpoint = f"127.0.0.1:{port}"
    with TemporaryDirectory() as folder, ExitStack() as stack:

        def start(what: str, command: list[str], ready: str) -> Watched:
            process = stack.enter_context(ChildProcess(what, command, Path(folder) / f"{what}.log"))
            process.wait_ready(ready, READY_S)
            return Watched(what, process)

        python = [sys.executable, "-m"]
        there = ["--name", name, "--connect", endpoint]
        watched = [
            start("lira twin", lira_command("twin", "--name", name, "--listen", endpoint), "serves"),
            start("lira drive", lira_command("drive", "camera-expert", *there), "drives"),
            start("joystick bridge", [*python, hand.__name__, name, endpoint, str(ear)], hand.READY),
            start("console ears", [*python, watcher.__name__, name, endpoint], watcher.READY),
        ]
        bus = stack.enter_context(on_bus(endpoint, name))
        work = watch(watched, bus, ear, minutes * 60.0)
    return [*(one.row() for one in watched), work.row()]


def watch(watched: list[Watched], bus: Bus, ear: int, duration_s: float) -> Work:
    """Sample everything until the time is over, and let things happen meanwhile."""
    applied, work = bus.reader(APPLIED), Work()
    began_s, seconds = time.monotonic(), 0
    while time.monotonic() < began_s + duration_s:
        if what := ROUND.get(seconds % ROUND_S):
            happen(what, bus, ear)
        for one in watched:
            one.sample()
        if (newest := applied.newest()) is not None:
            work.note(newest.message.source, moving=newest.message.twist != STOP)
        seconds += 1
        time.sleep(max(began_s + seconds * SAMPLE_S - time.monotonic(), 0.0))
    return work


def happen(what: str, bus: Bus, ear: int) -> None:
    """One of the things that happen on a operator_service."""
    if what == "reset":
        bus.ask(RESET, msgspec.json.encode(Episode()))
    elif what == "press":
        press_estop(bus)
    elif what == "release":
        release_estop(bus)
    elif what == "visit":
        Bus(bus.robot, connect=bus.endpoint).close()
    else:
        tell(ear, what)
