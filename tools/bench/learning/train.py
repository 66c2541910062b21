"""One training step (50 updates of 32) beside a plain float32 PyTorch loop, and what it does to the control loop.

Where Keras and TensorFlow are installed (`pip install keras tensorflow-cpu`; they are no dependency), it is put beside
these, too.

Where the processor has bfloat16 (the learner uses it where there is AVX512-BF16 or AMX), a step from scratch is 1.8 to
2.2 times as fast as Keras at f = 16, and 2.3 to 2.6 times (median of six runs: 2.5) at f = 32; in float32 1.2 times.
With f = 16 it is 22 GFLOP, nearly eight tenths of them the second convolution forward and back. What is left with
bfloat16 is memory: arrays of 1.8 MB go through the rectifier, the pooling and Adam, and nothing that was tried made
that less:

- the first convolution as a product of matrices (nine rows of shifted pictures), or all of the trunk's way back written
  out into arrays that are kept: as fast as now with bfloat16, 5 to 15 % faster in float32;
- the fusion layers' large product in bfloat16, too: as fast as now, as its weights have to be converted each time;
- eight pictures at a time, which stay in the cache: slower, each call costs too much;
- large pages for the heap; the rectifier within the first convolution's pass forward: as fast as now;
- in float32 products of matrices with half as many multiplications (Winograd's F(4, 3) along rows): 2 to 6 % at f = 16,
  15 to 19 % at f = 32; what is saved goes into rewriting rows.
"""

import statistics
import time
from functools import partial
from typing import Protocol

import numpy as np
import torch
from torch import Tensor, nn

from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.labels import Label
from lira.fusion.learning.learner import Learner
from lira.fusion.learning.trainer import Beginning, ProcessTrainer
from lira.fusion.policies.networks import ExpertNet, FusionNet
from lira.fusion.preprocess import Features, Shape
from lira.hal.messages import Driver
from lira.tools.bench import Row
from lira.tools.bench.learning import keras_reference

RUNS = 5
LABELS = 300
UPDATES, BATCH = 50, 32
CONTROL_PERIOD_S = 0.05
TRAINING_STEPS = 3  # with the control loop beside them
BINS = {16: 101, 32: 130}  # by filters: the simulated and the real robot

TRUNKS = ("full", "frozen")


class Trains(Protocol):
    """Whoever runs a training step."""

    def train_step(self) -> object:
        """Run one training step."""


def run() -> list[Row]:
    """Return one row per network and kind of training. All on one thread."""
    one_thread()
    rows: list[Row] = []
    for filters, bins in BINS.items():
        labels = random_labels(bins)
        plain = PlainLearner(filters, labels)
        learners = {trunks: make_learner(filters, trunks, labels) for trunks in TRUNKS}
        contenders: dict[str, Trains] = {"plain": plain, **learners}
        if keras_reference.installed():
            contenders["keras"] = keras_reference.KerasLearner(filters, labels, UPDATES, BATCH)
        seconds: dict[str, list[float]] = {name: [] for name in contenders}
        for k in range(1 + RUNS):
            for name, learner in contenders.items():
                began = time.perf_counter()
                learner.train_step()
                if k > 0:  # the first is for what is slow the first time
                    seconds[name].append(time.perf_counter() - began)
        median = {name: statistics.median(values) for name, values in seconds.items()}
        rows += [
            {
                "filters": filters,
                "trunks": trunks,
                "step_s": median[trunks],
                "reference_s": median["plain"],
                "speedup": median["plain"] / median[trunks],
                **({"keras_speedup": median["keras"] / median[trunks]} if "keras" in median else {}),
                **control_loop(filters, trunks, labels),
            }
            for trunks in TRUNKS
        ]
    return rows


def random_labels(bins: int) -> list[Label]:
    """Noise: the time does not depend on what there is to learn."""
    rng = np.random.default_rng(0)

    def label() -> Label:
        image = (rng.integers(0, 256, (32, 32)) / 255).astype(np.float32)
        seen = Features(image=image, scan=rng.random(bins, dtype=np.float32))
        return Label(seen, (float(rng.random()), float(rng.random())), Driver.HUMAN)

    return [label() for _ in range(LABELS)]


def shapes(filters: int) -> dict[str, Shape]:
    """What a robot's networks see."""
    return {"image": (32, 32), "scan": (BINS[filters],)}


def beginning(filters: int, trunks: str) -> Beginning:
    """A novice that has learned nothing."""
    network = FusionNet(shapes(filters), filters)
    learner = partial(Learner, network, batch=BATCH, updates=UPDATES, seed=0, frozen_trunks=trunks == "frozen")
    return Beginning(network.architecture, learner)


def make_learner(filters: int, trunks: str, labels: list[Label]) -> Learner:
    """Prepare a learner that knows the labels."""
    learner = beginning(filters, trunks).learner()
    for label in labels:
        learner.add(label)
    return learner


class PlainFusionNet(nn.Module):
    """The fusion network of Appendix B, written down as one would."""

    def __init__(self, bins: int, filters: int) -> None:
        super().__init__()
        self.camera = nn.Sequential(
            nn.Conv2d(1, filters, 3),
            nn.LeakyReLU(0.3),
            nn.Conv2d(filters, filters, 3),
            nn.LeakyReLU(0.3),
            nn.MaxPool2d(2),
            nn.Flatten(),
        )
        self.lidar = nn.Sequential(nn.Linear(bins, 64), nn.LeakyReLU(0.3), nn.Linear(64, 64), nn.LeakyReLU(0.3))
        self.fusion = nn.Sequential(
            nn.Linear(196 * filters + 64, 128),
            nn.LeakyReLU(0.3),
            nn.Linear(128, 128),
            nn.LeakyReLU(0.3),
            nn.Linear(128, 2),
            nn.Tanh(),
        )

    def forward(self, scan: Tensor, image: Tensor) -> Tensor:
        """Scan [n, bins] and image [n, 1, 32, 32] -> actions [n, 2]."""
        actions: Tensor = self.fusion(torch.cat([self.camera(image), self.lidar(scan)], dim=1))
        return actions


class PlainLearner:
    """The plain way to train: everything in float32, default Adam."""

    def __init__(self, filters: int, labels: list[Label]) -> None:
        self._network = PlainFusionNet(BINS[filters], filters)
        self._adam = torch.optim.Adam(self._network.parameters(), lr=1e-3)
        self._scans = torch.from_numpy(np.stack([label.features.scan for label in labels]))
        self._images = torch.from_numpy(np.stack([label.features.image for label in labels])[:, None])
        self._actions = torch.tensor([label.action for label in labels])

    def train_step(self) -> None:
        """Run one training step."""
        for _ in range(UPDATES):
            pick = torch.randint(len(self._actions), (BATCH,))
            actions = self._network(self._scans[pick], self._images[pick])
            loss = nn.functional.mse_loss(actions, self._actions[pick])
            self._adam.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            self._adam.step()


def control_loop(filters: int, trunks: str, labels: list[Label]) -> Row:
    """Decide at 20 Hz with all three networks while a process trains; a miss is a decision later than its period."""
    experts = [ExpertNet(*seen, filters).driving() for seen in shapes(filters).items()]
    trainer = ProcessTrainer(beginning(filters, trunks))
    for label in labels:
        trainer.add(label)
    policies = [*experts, trainer.network]
    took_s: list[float] = []
    steps = 0
    try:
        next_s = time.monotonic()
        while steps < TRAINING_STEPS:
            next_s += CONTROL_PERIOD_S
            time.sleep(max(0.0, next_s - time.monotonic()))
            weights = trainer.poll(next_s)
            if weights is not None:
                trainer.network.load_weights(weights)
                steps += 1
            label = labels[len(took_s) % len(labels)]
            for policy in policies:
                policy.act(label.features)
            trainer.add(label)
            if not trainer.pending and steps < TRAINING_STEPS:
                trainer.start(next_s)
            took_s.append(time.monotonic() - next_s)
            next_s = max(next_s, time.monotonic() - CONTROL_PERIOD_S)
    finally:
        trainer.close()
    return {
        "decisions": len(took_s),
        "deadline_misses": sum(took > CONTROL_PERIOD_S for took in took_s),
        "slowest_decision_ms": 1e3 * max(took_s),
    }
