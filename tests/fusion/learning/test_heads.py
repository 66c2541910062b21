"""Gradients written out, held to those that PyTorch finds."""

from itertools import pairwise

import pytest
import torch

from lira.fusion.learning.heads import Heads

N = 7


def made(heads, sizes, seed=0):
    random = torch.Generator().manual_seed(seed)
    pairs = list(pairwise(sizes))
    weights = [torch.randn(heads, before, after, generator=random) * 0.4 for before, after in pairs]
    return weights, [torch.randn(heads, 1, after, generator=random) for _, after in pairs], random


def by_autograd(weights, biases, x, actions, times):
    parameters = [each.clone().requires_grad_() for pair in zip(weights, biases, strict=True) for each in pair]
    seen = x.clone().requires_grad_()
    hidden = seen.expand(len(weights[0]), -1, -1)
    for k in range(0, len(parameters), 2):
        hidden = hidden @ parameters[k] + parameters[k + 1]
        hidden = torch.nn.functional.leaky_relu(hidden, 0.3) if k < len(parameters) - 2 else torch.tanh(hidden)
    losses = ((hidden - actions).square() * times).mean(dim=(1, 2))
    losses.sum().backward()
    return losses.detach(), torch.cat([each.grad.reshape(-1) for each in parameters]), seen.grad


@pytest.mark.parametrize("heads", [1, 3])
@pytest.mark.parametrize("sizes", [(11, 2), (11, 6, 5, 2)])
def test_losses_and_gradients_are_those_of_autograd(heads, sizes):
    weights, biases, random = made(heads, sizes)
    x, actions = torch.randn(N, sizes[0], generator=random), torch.rand(N, 2, generator=random)
    times = torch.rand(heads, N, 1, generator=random)
    losses, gradient, of_x = by_autograd(weights, biases, x, actions, times)
    ours = Heads(weights, biases)
    found, slope = ours.descend(x, actions, times)
    torch.testing.assert_close(found, losses)
    torch.testing.assert_close(ours.flat.grad, gradient)
    torch.testing.assert_close(torch.bmm(slope, ours.weights[0].transpose(1, 2)).sum(dim=0), of_x)


def test_what_is_put_back_is_what_the_optimiser_made_of_it():
    weights, biases, _ = made(1, (4, 3, 2))
    ours = Heads(weights, biases)
    before = [each.clone() for each in weights]
    torch.optim.SGD([ours.flat], lr=0.1).step()  # of no gradient
    ours.put_back(weights, biases)
    torch.testing.assert_close(weights, before)
    ours.flat.data += 1.0
    ours.put_back(weights, biases)
    torch.testing.assert_close(weights, [each + 1.0 for each in before])
