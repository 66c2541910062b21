"""Adam without `torch.optim`: to the bit what PyTorch's does, and nothing of its compiler is loaded for it."""

import torch
from fresh import python

from lira.fusion.learning.adam import Adam


def test_it_goes_where_that_of_pytorch_goes_to_the_bit():
    random = torch.Generator().manual_seed(3)
    shapes = [(40, 7), (7,), (5, 1, 3, 3), ()]
    ours = [torch.nn.Parameter(torch.randn(shape, generator=random)) for shape in shapes]
    theirs = [torch.nn.Parameter(each.detach().clone()) for each in ours]
    adam, reference = Adam(ours, 1e-3), torch.optim.Adam(theirs, lr=1e-3, fused=True)
    before = [each.detach().clone() for each in ours]
    for step in range(20):
        adam.zero_grad()
        reference.zero_grad()
        for mine, other in zip(ours[step % 2 :], theirs[step % 2 :], strict=True):  # some have no gradient at times
            mine.grad = torch.randn(mine.shape, generator=random)
            other.grad = mine.grad.clone()
        adam.step()
        reference.step()
    assert all(torch.equal(mine, other) for mine, other in zip(ours, theirs, strict=True))
    assert not any(torch.equal(mine, first) for mine, first in zip(ours, before, strict=True))


def test_who_trains_does_not_load_a_compiler():
    code = (
        "import sys, numpy as np\n"
        "from lira.fusion.learning.learner import Label, Learner\n"
        "from lira.fusion.policies.networks import FusionNet\n"
        "from lira.fusion.preprocess import Features\n"
        "shapes = {'image': (32, 32), 'scan': (8,)}\n"
        "learner = Learner(FusionNet(shapes, filters=4), seed=0, frozen_trunks=False, updates=2)\n"
        "seen = Features(**{name: np.ones(shape, np.float32) for name, shape in shapes.items()})\n"
        "learner.add(Label(seen, (1.0, 0.0), 'human'))\n"
        "learner.train_step()\n"
        "print({'torch._dynamo', 'torch.fx.experimental.symbolic_shapes'} & set(sys.modules))\n"
    )
    assert python(code).stdout == "set()\n"


def test_where_nothing_has_a_gradient_nothing_moves():
    parameter = torch.nn.Parameter(torch.ones(3))
    Adam([parameter], 1e-3).step()
    Adam([], 1e-3).step()
    assert torch.equal(parameter, torch.ones(3))
