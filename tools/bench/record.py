"""What a recorder costs: control with it and without it, in turns, at the full rates of `rosbot2`; and what it loses.

A driver answers every scan of a twin in real time. Beside it a watcher hears everything, in both halves, so that the
pictures are sent in both; what the watcher heard and the recorder did not write is lost.
"""

import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from lira.hal.bus.reader import Tap
from lira.hal.client.connect import connect, on_bus
from lira.hal.messages import Twist
from lira.tools.bench import Row, cpu_s
from lira.tools.bench.parts.answers import Answers
from lira.tools.bench.parts.robots import READY_S, twin_at_work
from lira.tools.launch.processes import ChildProcess, lira_command
from lira.tools.recording.beside import READY
from lira.tools.recording.reader import Recording

MINUTES = 1.0  # of each half, all turns together
TURNS = 3
WARM_UP_S = 2.0
POLL_S = 0.001
MOST_CPU = 0.10  # of a core
SLOWER_MS = 2.0  # in the middle of all answers: what counts as unchanged
TURN = Twist(0.0, 0.2)  # on the spot: nothing to run into

Heard = set[tuple[str, bytes | None, bytes]]


@dataclass(slots=True)
class Half:
    """What was measured in one of the two."""

    answers_ms: list[float] = field(default_factory=list)
    seconds: float = 0.0
    cpu_s: float = 0.0
    messages: int = 0
    lost: int = 0
    size_bytes: int = 0


def run(minutes: float = MINUTES) -> list[Row]:
    """Return one row: the two halves side by side."""
    without, beside = Half(), Half()
    with (
        twin_at_work("--world", "room", "--profile", "rosbot2", "--renderer", "sketch") as (name, endpoint, folder),
        driver(name, endpoint) as pair,
    ):
        drive(pair, WARM_UP_S, Half())
        for turn in range(TURNS):
            drive(pair, 60.0 * minutes / TURNS, without)
            record(pair, (name, endpoint), folder / f"rec{turn}", 60.0 * minutes / TURNS, beside)
    return [row(without, beside)]


def row(without: Half, beside: Half) -> Row:
    """Put the two side by side."""
    p50, p99 = quantiles(without.answers_ms)
    with_p50, with_p99 = quantiles(beside.answers_ms)
    cpu = beside.cpu_s / beside.seconds
    return {
        "profile": "rosbot2",
        "seconds": without.seconds,
        "p50_ms": p50,
        "p99_ms": p99,
        "recorded_p50_ms": with_p50,
        "recorded_p99_ms": with_p99,
        "cpu_share": cpu,
        "messages": beside.messages,
        "lost": beside.lost,
        "mb_per_minute": beside.size_bytes / 1e6 / (beside.seconds / 60.0),
        "flat": beside.lost == 0 and cpu < MOST_CPU and with_p50 < p50 + SLOWER_MS,
    }


def quantiles(values: list[float]) -> tuple[float, float]:
    """The middle one, and what one in a hundred exceeds."""
    return statistics.median(values), statistics.quantiles(values, n=100)[98]


@dataclass(slots=True)
class Pair:
    """The driver and the watcher."""

    answers: Answers
    tap: Tap


@contextmanager
def driver(name: str, endpoint: str) -> Iterator[Pair]:
    """Open both ends."""
    with connect(endpoint, name) as robot, on_bus(endpoint, name, watch=True) as watch:
        yield Pair(Answers(robot, TURN), watch.tap())


def drive(pair: Pair, seconds: float, half: Half) -> Heard:
    """Answer every scan for so long, and note how soon each answer was applied. Returns what the watcher heard."""
    heard: Heard = set()
    began_s = time.monotonic()
    while (now_s := time.monotonic()) < began_s + seconds:
        half.answers_ms += pair.answers.poll()
        heard |= {(each.key, each.attachment, each.payload) for each in pair.tap.poll()}
        time.sleep(POLL_S)
    half.seconds += now_s - began_s
    return heard


def record(pair: Pair, address: tuple[str, str], folder: Path, seconds: float, half: Half) -> None:
    """Drive beside a recorder, and compare what it wrote with what was heard."""
    words = ["record", "--name", address[0], "--connect", address[1], "--out", str(folder)]
    with ChildProcess("the recorder", lira_command(*words), folder.with_suffix(".log")) as recorder:
        recorder.wait_ready(READY, READY_S)
        drive(pair, WARM_UP_S, Half())  # what it takes to begin is no part of it
        before_s = cpu_s(recorder.pid)
        heard = drive(pair, seconds, half)
        half.cpu_s += cpu_s(recorder.pid) - before_s
    recording = Recording(folder)
    written = {(each.key, each.beside, each.payload) for each in recording.messages()}
    half.messages += len(heard)
    half.lost += len(heard - written)
    half.size_bytes += sum(path.stat().st_size for path in recording.files)
