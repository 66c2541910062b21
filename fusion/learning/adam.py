"""Adam (Kingma & Ba 2015) by PyTorch's own kernel, called without `torch.optim`.

Whoever makes one of PyTorch's optimisers loads its compiler, which takes seconds and 80 MB in every process that
trains; and before each step it looks its parameters through, which takes as long as a small step.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

BETAS = (0.9, 0.999)
EPSILON = 1e-8


class Adam:
    """Goes down the gradients of some parameters, to the bit as `torch.optim.Adam(..., fused=True)` does."""

    def __init__(self, parameters: Sequence[nn.Parameter], learning_rate: float) -> None:
        self._parameters: list[Tensor] = list(parameters)
        self._learning_rate = learning_rate
        self._means = [torch.zeros_like(each, requires_grad=False) for each in self._parameters]
        self._squares = [torch.zeros_like(each, requires_grad=False) for each in self._parameters]
        self._steps = [torch.zeros(()) for _ in self._parameters]

    @torch.no_grad()
    def step(self) -> None:
        """Change every parameter by its `grad`; one that has none stays, and so does all where none has one."""
        moved = [k for k, parameter in enumerate(self._parameters) if parameter.grad is not None]
        if not moved:
            return
        steps = [self._steps[k] for k in moved]
        torch._foreach_add_(steps, 1)
        torch._fused_adam_(
            [self._parameters[k] for k in moved],
            [gradient for parameter in self._parameters if (gradient := parameter.grad) is not None],
            [self._means[k] for k in moved],
            [self._squares[k] for k in moved],
            [],
            steps,
            lr=self._learning_rate,
            beta1=BETAS[0],
            beta2=BETAS[1],
            weight_decay=0.0,
            eps=EPSILON,
            amsgrad=False,
            maximize=False,
        )

    def zero_grad(self) -> None:
        """Forget all gradients."""
        for parameter in self._parameters:
            parameter.grad = None
