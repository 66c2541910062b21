"""A novice with an ensemble beside it, as it drives: what trains is in `policies/ensemble.py`."""

import numpy as np

from lira.fusion.inference.architecture import Weights
from lira.fusion.inference.layers import SLOPE
from lira.fusion.inference.networks import LayeredNet
from lira.fusion.preprocess import Features
from lira.hal.messages import FloatArray


class DrivingEnsemble(LayeredNet):
    """The novice drives; the members, heads on the same trunks, say how far they agree."""

    def opinions(self, seen: Features) -> FloatArray:
        """What each member would do, float32 [members, 2]."""
        hidden = np.broadcast_to(self.features(seen), (self.architecture.members, 1, self._joined.size))
        last = len(self._member_layers) - 1
        for k, (weight, bias) in enumerate(self._member_layers):
            hidden = np.matmul(hidden, weight) + bias
            hidden = np.tanh(hidden) if k == last else np.maximum(hidden, SLOPE * hidden)
        return hidden[:, 0]

    def _prepare(self, weights: Weights) -> None:
        super()._prepare(weights)
        count = len(self.architecture.layers)
        self._member_layers = [(weights[f"member_weights.{k}"], weights[f"member_biases.{k}"]) for k in range(count)]
