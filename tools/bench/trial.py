"""One trial of each of the usual methods, alone on a core: how long it takes, and what it spends its time on.

`processor_s` is what it took of the processor, and `seconds` what passed meanwhile: more, where others compute, too.
Shares are of the processor's time and add up to 1. `render` and `rays` are camera and lidar of the twin that is driven
and of the one in which the scripted teacher looks ahead, `teacher` is the rest of what it does, `inference` is what the
policies make of what they see, `training` is labels and learning; `rest` is motion, referee, control loop and
bookkeeping.
"""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from lira.fusion.methods.base import Method
from lira.fusion.teaching.teacher import ScriptedTeacher
from lira.sim_backend.camera import PinholeCamera
from lira.sim_backend.lidar import RayLidar
from lira.tools.bench import Row
from lira.tools.experiments.methods import USUAL
from lira.tools.experiments.trial import Trial, play

WORLD = "line-obstacles"
SEED = 200
SHARES = ("render", "rays", "teacher", "training", "inference", "rest")


def run() -> list[Row]:
    """Return a row for each method."""
    play(Trial(USUAL[0], "lane", SEED, laps=1, unseen=0))  # what is loaded and built but once
    return [measure(Trial(method, WORLD, SEED)) for method in USUAL]


def measure(trial: Trial) -> Row:
    """Play a trial, and say where its time went."""
    began_s, meter = time.perf_counter(), Meter()
    with watched(meter):
        outcome = play(trial)
    spent_s = meter.stop()
    processor_s = sum(spent_s.values())
    return {
        "method": trial.method.name,
        "seconds": time.perf_counter() - began_s,
        "processor_s": processor_s,
        "laps": len(outcome.laps),
        **{share: spent_s[share] / processor_s for share in SHARES},
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
