"""Where the time of a decision step goes while LIRA-SPF learns on `line-obstacles`, and what a whole run takes.

The run is that of `lira experiment`: in process, on one thread, with the scripted teacher, to the first proving run
that is passed. A part's time is what its calls took at one step, without the parts called in it.
"""

import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import msgspec

from lira.fusion.control import ControlLoop
from lira.fusion.learning import learner, novice
from lira.fusion.methods.lira import LiraSpf
from lira.fusion.methods.presets import METHODS
from lira.fusion.preprocess import Preprocessor
from lira.fusion.teaching.teacher import ScriptedTeacher
from lira.sim_backend.twin import Twin
from lira.tools.bench import Row
from lira.tools.experiments.trial import Trial, play

SEED = 0
LAPS = 12
WORLD = "line-obstacles"
PARTS: dict[str, tuple[type, str]] = {
    "twin: render and scan": (Twin, "read"),
    "twin: move": (Twin, "wait"),
    "preprocess": (Preprocessor, "__call__"),
    "experts and novice": (LiraSpf, "propose"),
    "teacher: look ahead": (ScriptedTeacher, "act"),
    "store a label": (LiraSpf, "learn"),
    "training step": (learner.Learner, "train_step"),
    "swap weights": (novice.Novice, "update"),
    "loop": (ControlLoop, "step"),
}


class Stopwatch:
    """Adds up the time of nested parts, each without what it calls; `steps` has the parts of every decision step."""

    def __init__(self) -> None:
        self.steps: list[dict[str, float]] = []
        self._open: list[str] = []
        self._since_s = 0.0
        self._now: defaultdict[str, float] = defaultdict(float)

    def around(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with its time taken."""

        def timed(*args: Any, **kwargs: Any) -> Any:
            self._book()
            name = self._name(part)
            self._open.append(name)
            try:
                return function(*args, **kwargs)
            finally:
                self._book()
                self._open.pop()
                if not self._open:
                    self.steps.append(dict(self._now))
                    self._now.clear()

        return timed

    def _name(self, part: str) -> str:
        """What the teacher renders and decides in its head belongs to its look ahead."""
        ahead = self._open and self._open[-1].startswith("teacher")
        return f"teacher: {part.removeprefix('twin: ')}" if ahead else part

    def _book(self) -> None:
        now_s = time.perf_counter()
        if self._open:
            self._now[self._open[-1]] += now_s - self._since_s
        self._since_s = now_s


def run() -> list[Row]:
    """Return one row per part and one for the whole run."""
    watch = Stopwatch()
    originals = {part: getattr(kind, name) for part, (kind, name) in PARTS.items()}
    try:
        for part, (kind, name) in PARTS.items():
            setattr(kind, name, watch.around(part, originals[part]))
        cpu_s, began_s = time.process_time(), time.perf_counter()
        outcome = play(Trial(METHODS["hold"], WORLD, SEED, laps=LAPS, unseen=0))
        cpu_s, took_s = time.process_time() - cpu_s, time.perf_counter() - began_s
    finally:
        for part, (kind, name) in PARTS.items():
            setattr(kind, name, originals[part])
    decided = [step for step in watch.steps if "loop" in step]
    total_s = sum(sum(step.values()) for step in decided)
    rows: list[Row] = []
    for part in sorted({part for step in decided for part in step}, key=lambda each: -share(decided, each)):
        times = [step[part] for step in decided if part in step]
        rows.append(
            {
                "part": part,
                "median_ms": 1e3 * statistics.median(times),
                "steps": len(times),
                "share_percent": 100 * share(decided, part) / total_s,
            }
        )
    steps_ms = [1e3 * sum(step.values()) for step in decided]
    rows.append({"part": "a decision step", "median_ms": statistics.median(steps_ms), "steps": len(steps_ms)})
    result = msgspec.structs.asdict(outcome.result)
    rows.append(
        {"part": "the whole run", "s": took_s, "cpu_s": cpu_s, **{key: result[key] for key in ("converged", "laps")}}
    )
    return rows


def share(steps: list[dict[str, float]], part: str) -> float:
    """Seconds that a part took in all."""
    return sum(step.get(part, 0.0) for step in steps)
