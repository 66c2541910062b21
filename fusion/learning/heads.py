"""The layers behind the trunks while they train, with their gradients written out.

In a training step of fifty small batches, recording and replaying what is computed (autograd) would take longer than
what is computed; and frozen trunks need no gradient at all.
"""

from collections.abc import Iterable, Sequence

import torch
from torch import Tensor
from torch.nn.functional import leaky_relu

from lira.fusion.policies.networks import SLOPE


class Heads:
    """One head, or several side by side: x [n, in] -> actions [heads, n, 2], leaky rectifiers between, tanh at the end.

    All weights are in one tensor, `flat`, and so are their gradients, so that one call of the optimiser does.
    """

    def __init__(self, weights: Sequence[Tensor], biases: Sequence[Tensor]) -> None:
        """Of each layer the weight [heads, in, out] and the bias [heads, 1, out], to begin with."""
        shapes = [tensor.shape for pair in zip(weights, biases, strict=True) for tensor in pair]
        both = [tensor.reshape(-1) for pair in zip(weights, biases, strict=True) for tensor in pair]
        self.flat = torch.nn.Parameter(torch.cat(both), requires_grad=False)
        self.flat.grad = torch.zeros_like(self.flat)
        tensors, gradients = _views(self.flat.data, shapes), _views(self.flat.grad, shapes)
        self.weights, self.biases = tensors[::2], tensors[1::2]
        self._weight_gradients, self._bias_gradients = gradients[::2], gradients[1::2]

    @torch.no_grad()
    def descend(self, x: Tensor, actions: Tensor, weights: Tensor) -> tuple[Tensor, Tensor]:
        """Set the gradients of the loss: for each head the mean of `weights` [heads, n, 1] times the squared error.

        Returns the losses [heads] and the derivatives at the first layer [heads, n, out], whose product with its
        weights is that of x.
        """
        outputs = self._forward(x)
        out = outputs.pop()
        error = out - actions
        weighted = error * weights
        losses = (weighted * error).mean(dim=(1, 2))
        slope = weighted * (2.0 / error[0].numel()) * (1.0 - out * out)
        for k in range(len(self.weights) - 1, 0, -1):
            hidden = outputs.pop()
            self._set(k, hidden, slope)
            slope = torch.bmm(slope, self.weights[k].transpose(1, 2))
            slope = torch.where(hidden > 0, slope, SLOPE * slope)
        self._set(0, x.expand(len(self.weights[0]), -1, -1), slope)
        return losses, slope

    @torch.no_grad()
    def put_back(self, weights: Sequence[Tensor], biases: Sequence[Tensor]) -> None:
        """Write what was learned into tensors of the shapes that it began with."""
        pairs = (*zip(weights, self.weights, strict=True), *zip(biases, self.biases, strict=True))
        for theirs, ours in pairs:
            theirs.copy_(ours)

    def _forward(self, x: Tensor) -> list[Tensor]:
        """What each layer gives out."""
        hidden, last = x.expand(len(self.weights[0]), -1, -1), len(self.weights) - 1
        outputs = []
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            hidden = torch.baddbmm(bias, hidden, weight)
            hidden = torch.tanh(hidden) if k == last else leaky_relu(hidden, SLOPE, inplace=True)
            outputs.append(hidden)
        return outputs

    def _set(self, k: int, x: Tensor, slope: Tensor) -> None:
        torch.bmm(x.transpose(1, 2), slope, out=self._weight_gradients[k])
        torch.sum(slope, dim=1, keepdim=True, out=self._bias_gradients[k])


def _views(flat: Tensor, shapes: Iterable[torch.Size]) -> list[Tensor]:
    views, at = [], 0
    for shape in shapes:
        views.append(flat[at : at + shape.numel()].view(shape))
        at += shape.numel()
    return views
