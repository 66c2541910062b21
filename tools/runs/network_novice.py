"""The novice that is a network, which torch trains."""

from collections.abc import Callable, Sequence

from lira.fusion.inference.networks import DrivingNet
from lira.fusion.learning.learner import Learner
from lira.fusion.learning.novice import LearningSettings, NetworkNovice, Trainer
from lira.fusion.policies.ensemble import EnsembleNet
from lira.fusion.policies.networks import FusionNet


def network_novice(
    experts: Sequence[DrivingNet],
    learning: LearningSettings,
    trainer: Callable[[Learner], Trainer],
    seed: int,
    *,
    frozen: bool,
    mirrored: bool,
    ensemble: int,
) -> NetworkNovice:
    """Make one that sees what these experts see: by copies of their trunks if `frozen`, else with trunks of its own."""
    network = FusionNet.from_experts(experts, frozen=frozen, seed=seed)
    if ensemble:
        network = EnsembleNet(network, ensemble, seed)
    learner = Learner(network, seed=seed, frozen_trunks=frozen, mirrored=mirrored)
    return NetworkNovice(network.driving(), trainer(learner), learning)
