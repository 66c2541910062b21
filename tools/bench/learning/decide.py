"""What a decision of camera, lidar and novice takes, beside the same networks in PyTorch, all on one thread."""

import statistics
import time
from collections.abc import Callable, Sequence

import numpy as np
import torch

from lira.fusion.inference.networks import DrivingNet
from lira.fusion.inference.threads import one_thread
from lira.fusion.policies.networks import ExpertNet, FusionNet, Network, batch_of_one
from lira.fusion.preprocess import Features, Shape
from lira.tools.bench import Row

RUNS = 15
DECISIONS = 100  # in a run: more than a network remembers, so that each is made
BINS = {16: 101, 32: 130}  # by filters: the simulated and the real robot
TRUNKS = ("shared", "own")  # whether the novice sees with its experts' trunks


def run() -> list[Row]:
    """Return one row per number of filters and kind of trunks."""
    one_thread()
    return [compare(filters, trunks) for filters in BINS for trunks in TRUNKS]


def compare(filters: int, trunks: str) -> Row:
    """Let both decide in turns, on another observation each time."""
    shapes: dict[str, Shape] = {"image": (32, 32), "scan": (BINS[filters],)}
    experts = [ExpertNet(*seen, filters, seed=1) for seen in shapes.items()]
    networks = [*experts, FusionNet.from_experts(experts, frozen=trunks == "shared", seed=2)]
    drivers = [network.driving() for network in networks]
    rng = np.random.default_rng(0)
    seen = [Features(**{n: rng.random(s, dtype=np.float32) for n, s in shapes.items()}) for _ in range(DECISIONS)]
    ours_ms, torch_ms = [], []
    for k in range(1 + RUNS):
        ours = ms_of(lambda each: numpy_decides(drivers, each), seen)
        plain = ms_of(lambda each: torch_decides(networks, each), seen)
        if k > 0:  # the first is for what is slow the first time
            ours_ms.append(ours)
            torch_ms.append(plain)
    ours, plain = statistics.median(ours_ms), statistics.median(torch_ms)
    return {"filters": filters, "trunks": trunks, "ms": ours, "torch_ms": plain, "speedup": plain / ours}


def numpy_decides(networks: Sequence[DrivingNet], seen: Features) -> None:
    """As the loop does."""
    for network in networks:
        network.act(seen)


def torch_decides(networks: Sequence[Network], seen: Features) -> None:
    """The plain way: each network on its own."""
    with torch.inference_mode():
        for network in networks:
            network(batch_of_one(seen))[0].tolist()


def ms_of(decide: Callable[[Features], None], observations: Sequence[Features]) -> float:
    """Mean over some decisions."""
    began = time.perf_counter()
    for seen in observations:
        decide(seen)
    return 1e3 * (time.perf_counter() - began) / len(observations)
