"""A fusion network with an ensemble beside it: heads on the same trunks, each trained on a bootstrap of the labels.

The ensemble is there to disagree, not to drive: the novice's own layers learn exactly what they learn without it.
"""

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from lira.fusion.inference.architecture import FUSION_HIDDEN, Architecture
from lira.fusion.policies.networks import SLOPE, FusionNet


class EnsembleNet(FusionNet):
    """The novice, and `members` more heads: fusion layers of the same sizes, initialised from seeds of their own."""

    def __init__(self, like: FusionNet, members: int, seed: int) -> None:
        super().__init__(like.shapes, like.filters)
        self.load_state_dict(like.state_dict())
        self.members = members
        heads = [
            FusionNet(like.shapes, like.filters, seed=one)
            for one in np.random.default_rng(seed).integers(2**31, size=members).tolist()
        ]
        layers = [[head.fc1, head.fc2, head.out] for head in heads]
        self.member_weights = nn.ParameterList(
            torch.stack([layer.weight.detach().T for layer in same]) for same in zip(*layers, strict=True)
        )
        sizes = (FUSION_HIDDEN, FUSION_HIDDEN, 2)
        self.member_biases = nn.ParameterList(torch.zeros(members, 1, size) for size in sizes)

    @property
    def architecture(self) -> Architecture:
        """The novice's, and so many members."""
        return replace(super().architecture, members=self.members)

    def member_heads(self, features: Tensor) -> Tensor:
        """Trunk output [n, size] -> what each member would do [members, n, 2]. No gradient reaches the trunks."""
        hidden = features.detach().expand(self.members, -1, -1)
        last = len(self.member_weights) - 1
        for k, (weight, bias) in enumerate(zip(self.member_weights, self.member_biases, strict=True)):
            hidden = torch.baddbmm(bias, hidden, weight)
            hidden = torch.tanh(hidden) if k == last else leaky_relu(hidden, SLOPE)
        return hidden
