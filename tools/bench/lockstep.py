"""The whole loop over the bus: the twin in lockstep in one process, the learner deciding and training in another."""

import statistics
from pathlib import Path
from tempfile import TemporaryDirectory

from fusion.record import StepRecord
from tools.bench import Row
from tools.processes import ChildProcess, free_port, lira_command
from tools.progress import Tail

RUNS = 3
WORLD = "race"
READY_S = 60.0
LIMIT_S = 300.0


def run() -> list[Row]:
    """Return one row: the median over fresh processes, and every run's factor."""
    factors = [measure() for _ in range(RUNS)]
    return [
        {
            "profile": "thesis-sim",
            "world": WORLD,
            "method": "lira",
            "real_time_factor": statistics.median(factors),
            "runs": factors,
        }
    ]


def measure() -> float:
    """Simulated seconds per second from the first decision to the last of one training lap and its proving run."""
    with TemporaryDirectory() as folder:
        record = Path(folder) / "run.jsonl"
        port = free_port()
        name, endpoint = f"bench_{port}", f"127.0.0.1:{port}"
        twin = lira_command("twin", "--name", name, "--world", WORLD, "--listen", endpoint, "--lockstep")
        words = ["--name", name, "--connect", endpoint, "--method", "lira", "--teacher", "scripted"]
        learner = lira_command("fusion", *words, "--train-laps", "1", "--unseen", "0", "--run", folder)
        with (
            ChildProcess("the twin", twin, Path(folder) / "twin.log") as server,
            ChildProcess("the learner", learner, Path(folder) / "fusion.log") as client,
        ):
            server.wait_ready("serves world", READY_S)
            client.wait(LIMIT_S)
            steps = [step for step in Tail(record).read() if isinstance(step, StepRecord)]
            if len(steps) < 2:
                raise client.failure()
    first, last = steps[0], steps[-1]
    return (last.decision.stamp_s - first.decision.stamp_s) / (last.elapsed_s - first.elapsed_s)
