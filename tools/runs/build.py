"""Puts learners together: which networks, which experts, which method, which teacher, which lap."""

from collections.abc import Callable, Sequence

import msgspec

from lira.fusion.experts.files import EXPERTS, experts_of
from lira.fusion.experts.load import as_expert, load_network, load_policy
from lira.fusion.experts.tasks import DEFAULT
from lira.fusion.inference.architecture import FUSION, KERNEL
from lira.fusion.inference.kernel_net import KernelNet
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.learning.kernel_novice import KernelNovice
from lira.fusion.learning.novice import Novice, used_turn
from lira.fusion.learning.trainer import NewTrainer
from lira.fusion.methods.base import Expert, Method, Policy
from lira.fusion.methods.context import Context, Trunks
from lira.fusion.methods.presets import Preset
from lira.fusion.teaching.teacher import ScriptedTeacher, TeacherSettings
from lira.hal.errors import ConfigError
from lira.hal.messages import Driver
from lira.hal.profile import RobotProfile
from lira.sim_backend.foresight import Foresight
from lira.sim_backend.world import World
from lira.tools.runs.network_novice import network_novice
from lira.tools.runs.warm_start import warm_up


def build_method(
    preset: Preset,
    profile: RobotProfile,
    seed: int,
    trainer: NewTrainer,
    pair: str = DEFAULT,
    more: Sequence[str | Expert | Policy] = (),
    build: Callable[[Context], Method] | None = None,
) -> Method:
    """Build a method around a pair of experts for this robot and `more` of the user's own, warm start included.

    `build` builds it where it is known to nobody by a name.
    Raises `ConfigError`, and `PluginError` for what somebody brought along.
    """
    loaded = load_pair(profile, pair)
    experts = (*(expert for _, expert in loaded), *(load_policy(each, profile, pair) for each in more))
    names = [expert.name for expert in experts]
    for name in names:
        if names.count(name) > 1 or name in tuple(Driver):
            raise ConfigError(f"more than one driver would be called '{name}'", "Give the expert another name.")

    def new_novice(*, ensemble: int = 0, trunks: Trunks | None = None, m: int | None = None) -> Novice:
        sees = seeing([network for network, _ in loaded])
        learning = preset.learning if m is None else msgspec.structs.replace(preset.learning, labels_per_step=m)
        novice: Novice
        if preset.kernel is not None:
            learning = msgspec.structs.replace(learning, turn=used_turn(profile.base))
            cruises = [expert.cruise for _, expert in loaded] if preset.kernel.fallback else None
            network = KernelNet.from_experts(sees, cruises)
            novice = KernelNovice(network, learning, preset.kernel, mirrored=preset.mirrored)
        else:
            frozen = (trunks or preset.trunks) == "frozen"
            novice = network_novice(
                sees, learning, trainer, seed, frozen=frozen, mirrored=preset.mirrored, ensemble=ensemble
            )
        warm_up(novice, preset.warm, profile, pair)
        return novice

    return (build or preset.build)(Context(profile, experts, seed, new_novice))


def seeing(experts: Sequence[DrivingNet]) -> Sequence[DrivingNet]:
    """Return the networks whose trunks a novice may see with. Raises `ConfigError` for those of another kind."""
    if any(expert.kind in (FUSION, KERNEL) for expert in experts):
        raise ConfigError(
            "the experts are of the wrong kind", f"Train them anew: lira train-expert {'|'.join(EXPERTS)}"
        )
    return experts


def load_pair(profile: RobotProfile, pair: str = DEFAULT) -> list[tuple[DrivingNet, Expert]]:
    """Load the expert of each sensor that a robot learns from. Raises `ConfigError`."""
    loaded = [(name, *load_network(f"{name}-expert", profile, pair)) for name in experts_of(profile)]
    return [(network, as_expert(name, network, file.cruise)) for name, network, file in loaded]


def teacher(skill: TeacherSettings, profile: RobotProfile, world: World, layout: int, seed: int) -> ScriptedTeacher:
    """Build a scripted teacher that can look ahead in a twin of its own."""
    return ScriptedTeacher(Foresight(profile, world, layout), profile, skill, seed)
