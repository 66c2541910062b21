"""A made-up run on a real world's course, so that reports and displays have something to show."""

import math
from pathlib import Path

import numpy as np

from lira.fusion.log.run_log import LapRecord, Pose, ResultRecord, RunRecord, RunWriter, StepRecord
from lira.hal.messages import Decision, ExpertView, LabelCounts
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.layout import build

PERIOD_S = 0.2
NEAR_M = 1.2


class Script:
    """Writes steps of a robot that follows the line and swerves around the boxes."""

    def __init__(self, path: Path, world: str, seed: int) -> None:
        self.writer = RunWriter(path)
        self.world = load_world(world)
        self.rng = np.random.default_rng(seed)
        self.time_s = 0.0
        self.seq = 0
        self.counts = {"human": 0, "expert": 0, "demonstration": 0}
        self.interventions = self.calls = self.training_steps = 0

    def lap(self, phase: str, lap: int, layout: int, *, help_until_m: float = 0.0, crash_at_m: float | None = None):
        floor = build(self.world, layout)
        boxes = [(block.x_m, block.y_m) for block in floor.blocks]
        began_s, progress_m, lateral_m, last_driver, last_call = self.time_s, 0.0, 0.0, "", "none"
        collisions = 0
        while progress_m < floor.curve.length_m:
            x, y, yaw = floor.curve.pose(progress_m, lateral_m)
            near = min((math.dist((x, y), box) for box in boxes), default=math.inf)
            driver, call, label = "novice", "none", None
            if phase == "train" and self.training_steps == 0:
                driver = label = "human"
            elif phase == "train" and near < NEAR_M:
                helped = progress_m < help_until_m
                driver = "human" if helped else "lidar"
                call = "feedback" if helped and near > NEAR_M / 2 else "attention" if not helped else "none"
                label = driver if self.rng.random() < 0.5 else None
            steer = math.copysign(1.0, lateral_m or 1.0) * (0.9 if near < NEAR_M else 0.0)
            turn = steer if driver == "human" else 0.6 * steer + self.rng.normal(0, 0.1)
            action = (1.0 if near > NEAR_M else 0.85, float(np.clip(turn, -1, 1)))
            self.count(driver, label, driver == "human" and last_driver != "human", call not in ("none", last_call))
            image = None
            if call not in ("none", last_call):
                image = np.clip(np.linspace(230, 60, 32)[:, None] + self.rng.normal(0, 8, (32, 32)), 0, 255)
                image[12:, 12:20] = 10
                image = image.astype(np.uint8).tobytes()
            self.writer.write(
                StepRecord(
                    self.decision(phase, lap, driver, call, action),
                    Pose(x, y, yaw, action[0], action[1], progress_m, lateral_m, near, False, False),
                    layout,
                    label,
                    image,
                    elapsed_s=self.time_s / 20,
                )
            )
            last_driver, last_call = driver, call
            target_m = 0.55 if near < NEAR_M else 0.0
            lateral_m += 0.25 * (target_m - lateral_m) + self.rng.normal(0, 0.01)
            progress_m += PERIOD_S * action[0] * (0.3 if call == "feedback" else 1.0)
            self.time_s += PERIOD_S
            self.seq += 1
            if crash_at_m is not None and progress_m > crash_at_m:
                collisions, crash_at_m, progress_m, lateral_m = 1, None, progress_m + 1.0, 0.0
        self.writer.write(
            LapRecord(
                phase, lap, layout, collisions == 0, self.interventions == 0, self.time_s - began_s, collisions, 0,
                0.12, self.counts["human"], self.interventions, self.calls, sum(self.counts.values()),
                self.training_steps, self.time_s / 20,
            )
        )  # fmt: skip

    def count(self, driver, label, intervened, called):
        self.interventions += intervened and self.training_steps > 0
        self.calls += called
        if label is not None:
            first = label == "human" and self.training_steps == 0
            self.counts["demonstration" if first else "human" if label == "human" else "expert"] += 1
            self.training_steps = sum(self.counts.values()) // 30

    def decision(self, phase, lap, driver, call, action):
        experts = tuple(
            ExpertView(name, action, 0.1 if name == driver else 0.01, name == driver) for name in ("camera", "lidar")
        )
        labels = LabelCounts(
            given_human=self.counts["human"] * 2,
            given_expert=self.counts["expert"] * 3,
            stored_human=self.counts["human"],
            stored_expert=self.counts["expert"],
            demonstration=self.counts["demonstration"],
        )
        return Decision(
            self.time_s, self.seq, driver, call, action, action, action if driver == "human" else None, experts, 0.06,
            labels, self.training_steps, self.interventions, self.calls, phase, lap,
        )  # fmt: skip


def write_run(
    folder: Path,
    *,
    world: str = "line-obstacles",
    seed: int = 1,
    unseen: int = 3,
    ended: bool = True,
    converged: bool = True,
) -> Path:
    """Write a whole run into `folder` and return the record's path."""
    path = folder / "run.jsonl"
    script = Script(path, world, seed)
    script.writer.write(
        RunRecord(world, "thesis-sim", "lira", "hold", 0, seed, f"lira demo --seed {seed} --note '<b>&'", "0.1.0")
    )
    script.lap("train", 1, 0, help_until_m=math.inf)
    script.lap("prove", 1, 0, crash_at_m=11.0)
    script.lap("train", 2, 0, help_until_m=20.0)
    script.lap("prove", 2, 0)
    for layout in range(1, unseen + 1):
        script.lap("unseen", layout, layout, crash_at_m=20.0 if layout == 2 else None)
    if ended:
        counts = script.counts
        script.writer.write(
            ResultRecord(
                converged, 2, counts["human"], counts["demonstration"], script.interventions, script.calls,
                sum(counts.values()), script.training_steps, script.time_s, script.time_s / 20,
            )
        )  # fmt: skip
    script.writer.close()
    return path
