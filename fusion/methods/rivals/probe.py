"""A small network beside the novice that predicts one number in [0, 1]: that it errs, or what that risks."""

from collections import deque

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import adaptive_avg_pool2d, binary_cross_entropy_with_logits

from lira.fusion.learning.adam import Adam
from lira.fusion.policies.networks import initialise
from lira.fusion.preprocess import Features
from lira.hal.messages import Action

PX = 8  # the picture is averaged down to so many pixels each way
HIDDEN = 64
RECENT = 400  # examples that count: older ones judged another novice
STEPS, BATCH, RATE = 100, 32, 3e-3
FEW = 1e-3  # a target above this is rare, and half of each batch
START = 20  # examples before anything is predicted


class Probe:
    """Learns from (features, action, target) and predicts targets: `targets` in [0, 1], soft ones allowed.

    Inputs are all features, pictures averaged down to 8 x 8, and the action. The rare targets above zero make up half
    of each batch, as in ThriftyDAgger's sampling. Predicts 0 until it has seen enough.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._random = np.random.default_rng(seed)
        self._examples: deque[tuple[Tensor, float]] = deque(maxlen=RECENT)
        self._network: nn.Sequential | None = None

    def add(self, features: Features, action: Action, target: float) -> None:
        """Keep one example."""
        self._examples.append((_inputs(features, action), target))

    def fit(self) -> None:
        """Train anew on what is kept: warm, from where it was."""
        if len(self._examples) < START:
            return
        x = torch.stack([inputs for inputs, _ in self._examples])
        y = torch.tensor([target for _, target in self._examples])
        self._network = self._network or _network(x.shape[1], self._seed)
        optimiser = Adam(list(self._network.parameters()), RATE)
        pools = [pool for pool in (torch.nonzero(y > FEW)[:, 0], torch.nonzero(y <= FEW)[:, 0]) if len(pool)]
        for _ in range(STEPS):
            picks = torch.cat([pool[self._random.integers(len(pool), size=BATCH // len(pools))] for pool in pools])
            loss = binary_cross_entropy_with_logits(self._network(x[picks])[:, 0], y[picks])
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()

    def predict(self, features: Features, action: Action) -> float:
        """The number expected here."""
        if self._network is None:
            return 0.0
        with torch.inference_mode():
            return float(torch.sigmoid(self._network(_inputs(features, action)[None])[0, 0]))


def _network(size: int, seed: int) -> nn.Sequential:
    network = nn.Sequential(nn.Linear(size, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 1))
    initialise(network, seed)
    return network


def _inputs(features: Features, action: Action) -> Tensor:
    seen = [_flat(torch.from_numpy(array)) for array in features.values()]
    return torch.cat([*seen, torch.tensor(action, dtype=torch.float32)])


def _flat(array: Tensor) -> Tensor:
    """A picture averaged down, anything else as it is."""
    return adaptive_avg_pool2d(array[None, None], PX).flatten() if array.ndim > 1 else array
