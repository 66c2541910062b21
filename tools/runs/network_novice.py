"""The novice that is a network, which torch trains: here it is only named, and loaded where that happens."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from lira.fusion.inference.architecture import FUSION, Architecture
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.learning.novice import LearningSettings, NetworkNovice
from lira.fusion.learning.trainer import Beginning, NewTrainer

if TYPE_CHECKING:
    from lira.fusion.learning.learner import Learner


def network_novice(
    experts: Sequence[DrivingNet],
    learning: LearningSettings,
    trainer: NewTrainer,
    seed: int,
    *,
    frozen: bool,
    mirrored: bool,
    ensemble: int,
) -> NetworkNovice:
    """Make one that sees what these experts see: by copies of their trunks if `frozen`, else with trunks of its own."""
    what = replace(Architecture.novice(FUSION, experts), members=ensemble)
    begun = trainer(Beginning(what, partial(new_learner, experts, seed, frozen, mirrored, ensemble)))
    return NetworkNovice(begun.network, begun, learning)


def new_learner(experts: Sequence[DrivingNet], seed: int, frozen: bool, mirrored: bool, ensemble: int) -> "Learner":
    """Make the learner of that network."""
    from lira.fusion.learning.learner import Learner
    from lira.fusion.policies.ensemble import EnsembleNet
    from lira.fusion.policies.networks import FusionNet

    network = FusionNet.from_experts(experts, frozen=frozen, seed=seed)
    if ensemble:
        network = EnsembleNet(network, ensemble, seed)
    return Learner(network, seed=seed, frozen_trunks=frozen, mirrored=mirrored)
