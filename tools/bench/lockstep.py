"""The whole loop over the bus in lockstep: the twin in one process, and LIRA-SPF deciding and learning in another.

What is timed is what the fusion service does at every step: read the sensors off the bus, preprocess, ask both experts
and the novice, Algorithm 1, labels to the demonstration log, the run record, the decision back onto the bus, training
in its own process. Nobody helps: the experts drive until the first training step, and after a crash the robot is put
down behind what it hit. A scripted teacher is left out on purpose: to look ahead it renders a second twin eight times a
step, which no person and no robot does.
"""

import statistics
import time
from functools import partial
from pathlib import Path

from lira.fusion.control import ControlLoop
from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.trainer import ProcessTrainer
from lira.fusion.log.label_log import DemonstrationLog
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import RunWriter
from lira.fusion.methods.base import Method
from lira.fusion.methods.presets import METHODS
from lira.hal.bus.topics import DECISION
from lira.hal.client.connect import connect
from lira.hal.client.remote import RemoteArena, RemoteRobot
from lira.hal.messages import Episode, Phase
from lira.tools.bench import Row
from lira.tools.bench.parts.robots import twin_at_work
from lira.tools.runs.build import build_method
from lira.tools.runs.names import LABELS, RECORD

RUNS = 3
WORLD = "race"
SIMULATED_S = 120.0
WARM_UP_S = 5.0
PUT_ON_M = 1.0


def run() -> list[Row]:
    """Return one row: medians over several runs with fresh processes, and every run's factor."""
    one_thread()
    runs = [measure(layout) for layout in range(RUNS)]
    median = {name: statistics.median(one[name] for one in runs) for name in runs[0]}
    factors = [one["real_time_factor"] for one in runs]
    return [{"profile": "thesis-sim", "world": WORLD, "method": "lira", **median, "runs": factors}]


def measure(layout: int) -> dict[str, float]:
    """Drive one layout and return how many simulated seconds went by per second, and what was done in them."""
    words = ["--world", WORLD, "--layout", str(layout), "--lockstep", "--renderer", "sketch"]
    with twin_at_work(*words) as (name, endpoint, folder), connect(endpoint, name) as robot:
        return drive(robot, layout, folder)


def drive(robot: RemoteRobot, layout: int, folder: Path) -> dict[str, float]:
    """Let LIRA-SPF drive and learn: first to warm up, then timed."""
    profile = robot.profile
    begun = METHODS["hold"].starting("experts")
    method = build_method(begun, profile, layout, partial(ProcessTrainer, adopt_after_s=profile.period_s))
    decisions = robot.bus.publisher(DECISION)
    try:
        with DemonstrationLog(folder / LABELS, profile) as log, RunWriter(folder / RECORD) as record:
            journal = Journal(
                keep=log.append, write=record.write, publish=lambda decision: decisions.put(decision, robot.now())
            )
            loop = ControlLoop(robot, truth=robot.state)
            loop.arm()
            drive_until(WARM_UP_S, robot, layout, loop, method, journal)
            began = time.perf_counter(), robot.now()
            drive_until(WARM_UP_S + SIMULATED_S, robot, layout, loop, method, journal)
            took_s, simulated_s = time.perf_counter() - began[0], robot.now() - began[1]
    finally:
        method.close()
    return {
        "real_time_factor": simulated_s / took_s,
        "steps": round(simulated_s / profile.period_s),
        "labels": method.novice.stored,
        "training_steps": method.novice.training_steps,
    }


def drive_until(
    end_s: float,
    robot: RemoteRobot,
    layout: int,
    loop: ControlLoop,
    method: Method,
    journal: Journal,
) -> None:
    """Drive until the robot's clock says so; after a crash or at the end it is put down anew."""
    while robot.now() < end_s:
        step = loop.step(method)
        if step is None:
            continue
        journal.note(step, phase=Phase.TRAIN, lap=1, layout=layout, training_steps=method.novice.training_steps)
        state = step.state
        if state is not None and (state.collided or state.lost or state.finished):
            start_m = 0.0 if state.finished else max(state.progress_m, 0.0) + PUT_ON_M
            RemoteArena(robot).reset(Episode(layout, start_m=start_m))
            method.reset()
