"""One training step as in the thesis: 50 minibatch updates of 32 labels, Adam, mean squared error, warm start."""

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from fusion.networks import CameraTrunk, LidarTrunk, Network
from fusion.networks import Weights as Weights
from fusion.preprocess import to_uint8
from hal.messages import Action, FloatArray


@dataclass(frozen=True, slots=True)
class Label:
    """What to do on what was seen. `source` is "human" or an expert's name, `weight` scales its squared error."""

    scan: FloatArray
    image: FloatArray
    action: Action
    source: str
    weight: float = 1.0


class Learner:
    """Trains a copy of a network on the labels it has been given.

    Deterministic for one seed, one number of threads and one kind of processor. Labels are kept once, in growing
    arrays: with `frozen_trunks` as the trunk's output, which is then never computed again, otherwise as the scan and
    an 8-bit image, which is what the camera gave.
    """

    def __init__(
        self,
        network: Network,
        *,
        batch: int = 32,
        updates: int = 50,
        learning_rate: float = 1e-3,
        seed: int,
        frozen_trunks: bool,
    ) -> None:
        self._network = copy.deepcopy(network).requires_grad_(True)
        for trunk in self._network.modules():
            if frozen_trunks and isinstance(trunk, CameraTrunk | LidarTrunk):
                trunk.requires_grad_(False)
            elif isinstance(trunk, CameraTrunk):
                trunk.reduced_precision = _has_bfloat16()
        self._frozen_trunks = frozen_trunks
        self._batch, self._updates = batch, updates
        self._random = np.random.default_rng(seed)
        self._inputs: list[_Rows] = []
        self._targets = _Rows((3,), torch.float32)  # linear, angular, weight
        self._learning_rate = learning_rate

    def __len__(self) -> int:
        return self._targets.count

    def add(self, label: Label) -> None:
        """Keep one label."""
        scan, image = torch.from_numpy(label.scan), torch.from_numpy(label.image)
        if self._frozen_trunks:
            with torch.inference_mode():
                rows = [self._network.features(scan[None], image[None])[0]]
        else:
            rows = [scan, torch.from_numpy(to_uint8(label.image))]
        if not self._inputs:
            self._inputs = [_Rows(tuple(row.shape), row.dtype) for row in rows]
        for store, row in zip(self._inputs, rows, strict=True):
            store.append(row)
        self._targets.append(torch.tensor([*label.action, label.weight]))

    def train_step(self) -> float:
        """Run one training step and return its mean loss. Raises `ValueError` without labels."""
        if not len(self):
            raise ValueError("there is nothing to learn from yet")
        picks = torch.from_numpy(self._random.integers(len(self), size=(self._updates, self._batch)))
        return sum(self._update(pick) for pick in picks) / self._updates

    def weights(self) -> Weights:
        """Copy the network's weights."""
        return self._network.weights()

    @cached_property
    def _adam(self) -> torch.optim.Adam:
        """Made by whoever trains: PyTorch's optimisers load for seconds and take 80 MB."""
        trained = [parameter for parameter in self._network.parameters() if parameter.requires_grad]
        return torch.optim.Adam(trained, lr=self._learning_rate, fused=True)

    def _update(self, pick: Tensor) -> float:
        inputs = [store.rows[pick] for store in self._inputs]
        if self._frozen_trunks:
            actions = self._network.head(inputs[0])
        else:
            actions = self._network(inputs[0], inputs[1].to(torch.float32) / 255)
        targets = self._targets.rows[pick]
        loss = ((actions - targets[:, :2]).square() * targets[:, 2:]).mean()
        self._adam.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self._adam.step()
        return loss.item()


def _has_bfloat16() -> bool:
    """Whether the processor convolves in bfloat16 natively; elsewhere that is slower than float32."""
    capable = torch.cpu.get_capabilities()
    return bool(capable.get("avx512_bf16") or capable.get("amx_bf16"))


class _Rows:
    """Rows of one shape in one array that doubles when it is full; `rows` is the filled part."""

    def __init__(self, shape: tuple[int, ...], dtype: torch.dtype) -> None:
        self._data = torch.empty((64, *shape), dtype=dtype)
        self.count = 0

    @property
    def rows(self) -> Tensor:
        return self._data[: self.count]

    def append(self, row: Tensor) -> None:
        if self.count == len(self._data):
            self._data = torch.cat([self._data, torch.empty_like(self._data)])
        self._data[self.count] = row
        self.count += 1
