"""Remembers what resolved ambiguities looked like, to tell which have been answered before."""

import numpy as np
import torch

from fusion.networks import FusionNet, Network
from fusion.preprocess import Features
from hal.messages import FloatArray

NEIGHBOUR = 3  # the third neighbour: one odd state in the memory is not enough


class Memory:
    """A nearest-neighbour memory of states in the trunks' features, grouped by intervention.

    A state is known if its third neighbour is no farther than the `share` quantile of the same distance among the
    states themselves, each measured to other interventions only (leave one out, a conformal threshold): of states like
    those in the memory that share is known again. Each trunk's features have length 1, so that both count the same.
    """

    def __init__(self, network: Network, share: float) -> None:
        self._network = network
        self._share = share
        self._rows: list[FloatArray] = []
        self._groups: list[int] = []
        self._group, self._limit = 0, 0.0

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, features: Features) -> None:
        """Add a state to the intervention that is under way."""
        self._rows.append(self._describe(features))
        self._groups.append(self._group)

    def end(self) -> None:
        """End the intervention, if there was one: from now on its states are known."""
        if not self._groups or self._groups[-1] != self._group:
            return
        self._group += 1
        rows, groups = np.stack(self._rows), np.asarray(self._groups)
        distance = np.sqrt(np.maximum(4.0 - 2.0 * rows @ rows.T, 0.0))  # both parts of both have length 1
        distance[groups[:, None] == groups[None, :]] = np.inf
        if len(rows) > NEIGHBOUR:
            third = np.partition(distance, NEIGHBOUR - 1, axis=1)[:, NEIGHBOUR - 1]
            self._limit = float(np.quantile(third, self._share, method="lower")) if np.isfinite(third).any() else 0.0

    def knows(self, features: Features) -> bool:
        """Whether a human has resolved what looks like this."""
        if self._group < 2 or len(self._rows) < NEIGHBOUR or not np.isfinite(self._limit):
            return False
        closeness = np.stack(self._rows) @ self._describe(features)
        third = float(np.sort(closeness)[-NEIGHBOUR])
        return float(np.sqrt(max(4.0 - 2.0 * third, 0.0))) <= self._limit

    def _describe(self, features: Features) -> FloatArray:
        """Features of both trunks, each of length 1, float32 [n]."""
        with torch.inference_mode():
            row = self._network.features(torch.from_numpy(features.scan)[None], torch.from_numpy(features.image)[None])[
                0
            ]
        described: FloatArray = row.numpy().copy()
        size = self._network.camera.size if isinstance(self._network, FusionNet) else len(described)
        described[:size] /= max(float(np.linalg.norm(described[:size])), 1e-9)
        described[size:] /= max(float(np.linalg.norm(described[size:])), 1e-9)
        return described
