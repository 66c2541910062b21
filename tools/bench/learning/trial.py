"""Trials of each of the usual methods, alone on a core: how long one takes, and what it spends its time on.

A trial takes as many laps as its novice needs, which differ widely: numbers are medians over the trials of a few seeds,
but for the shares, which are of all of them together. `processor_s_per_lap` says more of the code than of the novices.

`processor_s` is what a trial took of the processor, and `seconds` what passed meanwhile: more, where others compute.
Shares are of the processor's time and add up to 1. `render` and `rays` are camera and lidar of the twin that is driven
and of the one in which the scripted teacher looks ahead, `teacher` is the rest of what it does, `inference` is what the
policies make of what they see, `training` is labels and learning; `rest` is motion, referee, control loop and
bookkeeping.
"""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from statistics import median
from typing import Any

from lira.fusion.methods.base import Method
from lira.fusion.teaching.teacher import ScriptedTeacher
from lira.sim_backend.camera import PinholeCamera
from lira.sim_backend.lidar import RayLidar
from lira.tools.bench import Row
from lira.tools.experiments.methods import USUAL
from lira.tools.experiments.trial import Trial, play

WORLD = "line-obstacles"
SEED = 200  # the first
SEEDS = 3
SHARES = ("render", "rays", "teacher", "training", "inference", "rest")


def run(seeds: int = SEEDS) -> list[Row]:
    """Return a row for each method, from so many trials."""
    play(Trial(USUAL[0], "lane", SEED, laps=1, unseen=0))  # what is loaded and built but once
    return [
        summary(method.name, [measure(Trial(method, WORLD, SEED + number)) for number in range(seeds)])
        for method in USUAL
    ]


@dataclass(frozen=True, slots=True)
class Spent:
    """What one trial took: by the clock, of the processor by share, and in laps."""

    seconds: float
    by_share_s: Mapping[str, float]
    laps: int

    @property
    def processor_s(self) -> float:
        """Of the processor, all together."""
        return sum(self.by_share_s.values())


def measure(trial: Trial) -> Spent:
    """Play a trial, and say where its time went."""
    began_s, meter = time.perf_counter(), Meter()
    with watched(meter):
        outcome = play(trial)
    by_share_s = dict(meter.stop())
    return Spent(time.perf_counter() - began_s, by_share_s, len(outcome.laps))


def summary(method: str, trials: Sequence[Spent]) -> Row:
    """Sum up a method's trials."""
    processor_s = sum(trial.processor_s for trial in trials)
    return {
        "method": method,
        "seeds": len(trials),
        "seconds": median(trial.seconds for trial in trials),
        "processor_s": median(trial.processor_s for trial in trials),
        "processor_s_worst": max(trial.processor_s for trial in trials),
        "processor_s_per_lap": median(trial.processor_s / trial.laps for trial in trials),
        "laps": median(trial.laps for trial in trials),
        **{share: sum(trial.by_share_s.get(share, 0.0) for trial in trials) / processor_s for share in SHARES},
    }


class Meter:
    """Seconds of the processor by share. What is called within something else is its own share's, not the other's."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = defaultdict(float)
        self._open = ["rest"]
        self._since_s = time.process_time()

    def timed(self, share: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """Make a function count for a share."""

        def work_timed(*args: object, **words: object) -> object:
            self._turn()
            self._open.append(share)
            try:
                return work(*args, **words)
            finally:
                self._turn()
                self._open.pop()

        return work_timed

    def stop(self) -> dict[str, float]:
        """Return what was counted, up to now."""
        self._turn()
        return self._seconds

    def _turn(self) -> None:
        """What has passed since the last turn belongs to what is open."""
        now_s = time.process_time()
        self._seconds[self._open[-1]] += now_s - self._since_s
        self._since_s = now_s


@contextmanager
def watched(meter: Meter) -> Iterator[None]:
    """Let a trial's parts count for their shares."""
    foresee = ScriptedTeacher._foresee

    def foresee_watched(self: ScriptedTeacher, state: Any, seen: Any, policy: Callable[..., Any], steps: int) -> Any:
        return foresee(self, state, seen, meter.timed("inference", policy), steps)

    with ExitStack() as put_back:
        for owner, name, share in (
            (PinholeCamera, "render", "render"),
            (RayLidar, "scan", "rays"),
            (ScriptedTeacher, "act", "teacher"),
            *((kind, name, "inference") for kind in methods() for name in ("propose", "propose_all")),
            *((kind, name, "training") for kind in methods() for name in ("update", "learn")),
        ):
            if name in vars(owner):
                swap(put_back, owner, name, meter.timed(share, vars(owner)[name]))
        swap(put_back, ScriptedTeacher, "_foresee", foresee_watched)
        yield


def swap(put_back: ExitStack, owner: type, name: str, work: Callable[..., Any]) -> None:
    """Replace a class's function until everything is put back."""
    put_back.callback(setattr, owner, name, vars(owner)[name])
    setattr(owner, name, work)


def methods(kind: type[Method] = Method) -> list[type[Method]]:
    """Every kind of method that is loaded."""
    return [kind, *(each for below in kind.__subclasses__() for each in methods(below))]
