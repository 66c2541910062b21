"""A third expert of your own in LIRA-SPF: a black box beside the camera's and the lidar's.

From a shell: lira demo --expert examples/02_my_expert.py:wall
"""

from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import lira


def wall(seen: lira.Features) -> tuple[float, float]:
    """Turn left where something is near on the right. `scan` begins there; 1.0 is free, 0.0 is touched."""
    return 1.0, 0.8 if seen.scan[:50].min() < 0.4 else 0.0


def main() -> None:
    """Let a scripted teacher teach for one lap, and count who drove and who taught."""
    # `cruise` is what it does where there is nothing to react to: it counts as active when it does something else.
    mine = lira.Expert("wall", wall, cruise=(1.0, 0.0))
    with TemporaryDirectory() as folder, lira.simulate("lane") as robot:
        taught = lira.teach(robot, "lira", more_experts=[mine], laps=1, unseen=0, folder=folder)
        steps = [each for each in lira.read_run(Path(folder) / "run.jsonl") if isinstance(each, lira.StepRecord)]
    training = [step for step in steps if step.decision.phase is lira.Phase.TRAIN]
    print("who drove:   ", dict(Counter(step.decision.driver for step in training)))
    print("who taught:  ", dict(Counter(step.label for step in training if step.label)))
    print("wall active: ", sum(step.decision.experts[2].active for step in training), "steps")
    print("after one lap the novice", "drives alone" if taught.converged else "does not drive alone yet")


if __name__ == "__main__":
    main()
