"""From what a network is and its weights to one that drives."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from lira.fusion.inference.architecture import KERNEL, Architecture
from lira.fusion.inference.ensemble import DrivingEnsemble
from lira.fusion.inference.kernel_net import KernelNet
from lira.fusion.inference.networks import DrivingNet, LayeredNet


def driving(architecture: Architecture, weights: Mapping[str, NDArray[Any]]) -> DrivingNet:
    """Build what drives. Raises `ValueError` for weights that do not fit or are not finite."""
    if architecture.kind == KERNEL:
        return KernelNet(architecture, weights)
    return (DrivingEnsemble if architecture.members else LayeredNet)(architecture, weights)


def alone(network: DrivingNet) -> DrivingNet:
    """Return a copy of a network, without an ensemble that only doubts."""
    architecture = replace(network.architecture, members=0)
    weights = network.weights()
    return driving(architecture, {name: weights[name] for name in architecture.weights})
