"""One training step as in the thesis: 50 minibatch updates of 32 labels, Adam, mean squared error, warm start."""

import copy
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from lira.fusion.inference.architecture import Weights
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.learning.adam import Adam
from lira.fusion.learning.allocator import keep_freed_memory
from lira.fusion.learning.heads import Heads
from lira.fusion.learning.label_store import FileRows
from lira.fusion.learning.labels import Label, mirror
from lira.fusion.policies.ensemble import EnsembleNet
from lira.fusion.policies.growing import Rows
from lira.fusion.policies.networks import Inputs, Network, PictureTrunk, ScanTrunk
from lira.fusion.preprocess import MODALITIES

RESIDENT_BYTES = 128 * 2**20  # of inputs in memory; 10,000 labels with frozen trunks, 92,000 without
TRUNKS = "trunks"  # what is kept instead of the features where trunks are frozen
BOOTSTRAP = 0xB007  # the ensemble's draws are a stream of their own, and leave the novice's alone


class Learner:
    """Trains a copy of a network on the labels it has been given, and with `mirrored` on their mirror images too.

    Deterministic for one seed, one number of threads and one kind of processor. Labels are kept once, in growing
    arrays: with `frozen_trunks` as the trunks' output (3,200 floats, 12.8 kB), which is then never computed again,
    otherwise as the features it looks at, pictures in 8 bits (1.4 kB for a scan and an image). From `resident_bytes`
    on, the features of further labels go to a temporary file, and the trunks see them when they are drawn.

    An `EnsembleNet` gets its members trained as well: a label counts for each as often as a draw from Poisson(1) says,
    the bootstrap of a stream.
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
        mirrored: bool = False,
        resident_bytes: int = RESIDENT_BYTES,
    ) -> None:
        self._network = copy.deepcopy(network).requires_grad_(True)
        for trunk in self._network.modules():
            if frozen_trunks and isinstance(trunk, PictureTrunk | ScanTrunk):
                trunk.requires_grad_(False)
            elif isinstance(trunk, PictureTrunk):
                trunk.reduced_precision = _has_bfloat16()
        if not frozen_trunks:
            keep_freed_memory()
        self._frozen_trunks = frozen_trunks
        self._mirrored = mirrored
        self._batch, self._updates = batch, updates
        self._random = np.random.default_rng(seed)
        self._bootstrap = np.random.default_rng([seed, BOOTSTRAP])
        self._resident_bytes = resident_bytes
        self._inputs: dict[str, Rows[Any]] = {}
        self._spilled: FileRows | None = None
        self._members = self._network.members if isinstance(self._network, EnsembleNet) else 0
        self._targets = Rows((3 + self._members,), np.float32)  # linear, angular, weight, times for each member
        self._learning_rate = learning_rate

    def __len__(self) -> int:
        return self._targets.count

    def add(self, label: Label) -> None:
        """Keep one label. Raises `OSError` when it does not fit the memory and the temporary folder is full."""
        self._keep(label)
        if self._mirrored:
            self._keep(mirror(label))

    def train_step(self) -> float:
        """Run one training step and return its mean loss. Raises `ValueError` without labels."""
        if not len(self):
            raise ValueError("there is nothing to learn from yet")
        picks = torch.from_numpy(self._random.integers(len(self), size=(self._updates, self._batch)))
        losses = [self._update(pick) for pick in picks]
        return float(torch.stack(losses).mean())

    def weights(self) -> Weights:
        """Copy the network's weights."""
        if "_heads" in self.__dict__:  # it has trained
            self._heads.put_back(*self._layers())
            if self._members:
                self._doubters.put_back(*self._member_layers())
        return self._network.weights()

    # Made by whoever trains, which may be another process than the one that gave the network.

    @cached_property
    def _heads(self) -> Heads:
        """The layers behind the trunks; those of `_network` are not up to date."""
        return Heads(*self._layers())

    @cached_property
    def _doubters(self) -> Heads:
        """Those of the ensemble's members."""
        return Heads(*self._member_layers())

    def _layers(self) -> tuple[list[Tensor], list[Tensor]]:
        """Weights [1, in, out] and biases [1, 1, out] of the network's layers behind the trunks, in its memory."""
        layers = [getattr(self._network, name) for name in self._network.architecture.layers]
        return [layer.weight.data.T[None] for layer in layers], [layer.bias.data[None, None] for layer in layers]

    def _member_layers(self) -> tuple[list[Tensor], list[Tensor]]:
        """The same of an ensemble's members [members, in, out] and [members, 1, out]."""
        assert isinstance(self._network, EnsembleNet)
        return [each.data for each in self._network.member_weights], [each.data for each in self._network.member_biases]

    @cached_property
    def _trunks(self) -> list[nn.Parameter]:
        """What trains of the trunks: nothing of frozen ones."""
        trunks = self._network.trunks.values()
        return [each for trunk in trunks for each in trunk.parameters() if each.requires_grad]

    @cached_property
    def _eyes(self) -> DrivingNet:
        """The same network as it drives: what a driver in this process has just seen its trunks remember."""
        return self._network.driving()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_eyes"}  # it belongs to a process

    @cached_property
    def _adam(self) -> Adam:
        heads = [self._heads.flat, *([self._doubters.flat] if self._members else [])]
        return Adam([*heads, *self._trunks], self._learning_rate)

    def _keep(self, label: Label) -> None:
        kept = {name: MODALITIES[name].keep(label.features[name]) for name in self._network.shapes}
        if self._spilled is not None:
            self._spilled.append(kept)
        else:
            self._keep_in_memory(label, kept)
        times = self._bootstrap.poisson(1.0, self._members) if self._members else ()
        self._targets.append([*label.action, label.weight, *times])

    def _keep_in_memory(self, label: Label, kept: dict[str, NDArray[Any]]) -> None:
        rows = kept
        if self._frozen_trunks:
            rows = {TRUNKS: self._eyes.features(label.features)}
        if not self._inputs:
            self._inputs = {name: Rows(row.shape, row.dtype) for name, row in rows.items()}
        for name, store in self._inputs.items():
            store.append(rows[name])
        if (self._resident + 1) * sum(store.row_bytes for store in self._inputs.values()) > self._resident_bytes:
            self._spilled = FileRows(kept)

    def _update(self, pick: Tensor) -> Tensor:
        """Go one step down the mean squared error of some labels, and return it."""
        features = self._features(pick)
        seen, targets = features.detach(), _picked(self._targets, pick)
        actions, weights = targets[:, :2], targets[:, 2:3]
        losses, slope = self._heads.descend(seen, actions, weights[None])
        if self._trunks:
            for parameter in self._trunks:
                parameter.grad = None
            _Known.apply(features, slope[0] @ self._heads.weights[0][0].T).backward()  # type: ignore[no-untyped-call]
        if self._members:
            times = targets[:, 3:].T.unsqueeze(2)
            self._doubters.descend(seen, actions, times * weights)
        self._adam.step()
        return losses[0]

    def _features(self, pick: Tensor) -> Tensor:
        """Trunk output of some labels [n, size], from wherever they are kept."""
        if self._spilled is None:
            kept = {name: _picked(store, pick) for name, store in self._inputs.items()}
            return kept[TRUNKS] if self._frozen_trunks else self._network.features(_scaled(kept))
        near = pick < self._resident
        kept = {name: _picked(store, pick[near]) for name, store in self._inputs.items()}
        far = self._spilled.read((pick[~near] - self._resident).tolist())
        if not self._frozen_trunks:
            both = {name: torch.cat([array, far[name]]) for name, array in kept.items()}
            features = self._network.features(_scaled(both))
        else:
            features = torch.cat([kept[TRUNKS], self._frozen_features(_scaled(far))])
        order = torch.cat([near.nonzero(), (~near).nonzero()])[:, 0]
        return features[order.argsort()]

    @property
    def _resident(self) -> int:
        """How many labels are in memory."""
        return next(iter(self._inputs.values())).count

    def _frozen_features(self, inputs: Inputs) -> Tensor:
        with torch.no_grad():
            return self._network.features(inputs)


class _Known(torch.autograd.Function):
    """A number whose slope is known. To go back from the features themselves, PyTorch would load its symbolic shapes
    first, which takes half a second.
    """

    @staticmethod
    def forward(ctx: Any, features: Tensor, slope: Tensor) -> Tensor:
        """Any number does."""
        ctx.save_for_backward(slope)
        return features.new_zeros(())

    @staticmethod
    def backward(ctx: Any, _: Tensor) -> tuple[Tensor, None]:
        """The slope at the features."""
        (slope,) = ctx.saved_tensors
        return slope, None


def _picked(store: Rows[Any], pick: Tensor) -> Tensor:
    """Some of the rows."""
    return torch.from_numpy(store.rows).index_select(0, pick)


def _scaled(kept: Inputs) -> dict[str, Tensor]:
    """Turn what is kept in 8 bits back into [0, 1]."""
    return {
        name: array.to(torch.float32) / 255 if array.dtype == torch.uint8 else array for name, array in kept.items()
    }


def _has_bfloat16() -> bool:
    """Whether the processor convolves in bfloat16 natively; elsewhere that is slower than float32."""
    capable = torch.cpu.get_capabilities()
    return bool(capable.get("avx512_bf16") or capable.get("amx_bf16"))
