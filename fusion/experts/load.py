"""Policies by name: those of the project, a user's own checkpoint by path, or a black box by MODULE:OBJECT."""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from lira.fusion.experts.files import EXPERTS as NAMES
from lira.fusion.experts.files import SUFFIX, check_pair, expert_path, who_has
from lira.fusion.experts.tasks import DEFAULT
from lira.fusion.inference.checkpoint import Checkpoint, load_checkpoint
from lira.fusion.inference.kernel_net import KernelNet
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.methods.base import Alone, Expert, Method, Policy
from lira.fusion.methods.shield import Shield, Shielded
from lira.fusion.methods.stop_and_ask import Doubtful
from lira.fusion.preprocess import MODALITIES, Features, Shape, shapes_of
from lira.hal.errors import ConfigError, PluginError
from lira.hal.messages import Action
from lira.hal.plugins import EXPERTS
from lira.hal.profile import RobotProfile

SHIPPED = {f"{name}-expert": name for name in NAMES}


def load_network(name_or_path: str, profile: RobotProfile, pair: str = DEFAULT) -> tuple[DrivingNet, Checkpoint]:
    """Load a policy and check that it fits the robot. Raises `ConfigError` or `StorageError`."""
    path = expert_path(name_or_path, profile, pair)
    network, checkpoint = load_checkpoint(path)
    own = {**shapes_of(profile), "filters": (profile.features.filters,)}
    seen = {**checkpoint.features, **({"filters": (checkpoint.filters,)} if checkpoint.filters else {})}
    if unseen := [MODALITIES[name].sensor for name in checkpoint.features if name not in own]:
        inputs = " and ".join(profile.features.inputs)
        what = f"{path} was trained for '{checkpoint.profile}' and needs its {' and '.join(unseen)}"
        what += f"; a robot of the profile '{profile.name}' learns from {inputs} alone"
        raise ConfigError(what, who_has([MODALITIES[name].sensor for name in checkpoint.features]))
    if any(own.get(name) != shape for name, shape in seen.items()):
        raise ConfigError(
            f"{path} was trained for '{checkpoint.profile}' ({_sizes(seen)}), not for '{profile.name}' ({_sizes(own)})",
            "Use the checkpoint of this profile, or start the robot with the profile it was trained for: "
            f"--profile {checkpoint.profile}.",
        )
    return network, checkpoint


def _sizes(shapes: Mapping[str, Shape]) -> str:
    return ", ".join(f"{name} {'x'.join(map(str, shape))}" for name, shape in shapes.items())


def as_expert(name: str, network: DrivingNet, cruise: Action | None) -> Expert:
    """Wrap a network as a black box."""
    return Expert(name, network.act) if cruise is None else Expert(name, network.act, cruise)


def check_named(policies: Iterable[str | Expert | Policy], pair: str | None = None) -> None:
    """Raise what loading these would raise whatever the robot: before one is looked for, or anything is started."""
    if pair is not None:
        check_pair(pair)
    for given in policies:
        if isinstance(given, str):
            _ = load_checkpoint(Path(given)) if given.endswith(SUFFIX) else EXPERTS.find(given, SHIPPED)


def load_policy(given: str | Expert | Policy, profile: RobotProfile, pair: str = DEFAULT) -> Expert:
    """Load a policy: an expert of a pair, a checkpoint, or a black box, by MODULE:OBJECT or as it is.

    A network is named after its sensor, or after what kind of novice it is; a black box after its object. Raises
    `ConfigError`, `StorageError` for a damaged file, `PluginError` for a plug-in that does not load.
    """
    return _load(given, profile, pair)[0]


def load_alone(
    given: str | Expert | Policy,
    profile: RobotProfile,
    pair: str = DEFAULT,
    *,
    ask: bool = False,
    shield: bool = False,
) -> Method:
    """Load a policy to drive alone; with `ask` it stands and calls where it doubts, with `shield` behind a shield.

    Raises what `load_policy` raises, and `ConfigError` for one that cannot tell.
    """
    expert, network = _load(given, profile, pair)
    alone: Method = Alone(expert.name, expert.act)
    if ask:
        if not isinstance(network, KernelNet):
            raise ConfigError(f"'{given}' cannot tell what it does not know", "A novice taught by plus can.")
        if not network.proven:
            what = f"'{given}' cannot tell what it does not know: it was not proven after its last label"
            raise ConfigError(what, "Have it proven, as lira teach and lira demo do, or leave out --ask.")
        alone = Doubtful(expert.act, network.doubts)
    return Shielded(alone, Shield(profile)) if shield else alone


def _load(given: str | Expert | Policy, profile: RobotProfile, pair: str) -> tuple[Expert, DrivingNet | None]:
    """Load a policy, and the network that it is; None for a black box."""
    if not isinstance(given, str):
        names = (getattr(given, "name", None), getattr(given, "__name__", None), type(given).__name__)
        return own_expert(given, next(str(name) for name in names if name), profile), None
    if not given.endswith(SUFFIX):
        found = EXPERTS.find(given, SHIPPED)
        if found not in NAMES:
            return own_expert(found, given, profile), None
    network, checkpoint = load_network(given, profile, pair)
    return as_expert(checkpoint.kind, network, checkpoint.cruise), network


def own_expert(found: object, name: str, profile: RobotProfile) -> Expert:
    """Make an expert of what a plug-in offers: an `Expert`, a function of `Features`, or a class of such functions.

    A class is made from the robot's profile. Raises `ConfigError` for anything else.
    """
    if isinstance(found, type):
        found = cast(Callable[[RobotProfile], object], found)(profile)
    if isinstance(found, Expert):
        return replace(found, act=checked(found.act, name))
    if not callable(found):
        what = f"the policy '{name}' is a {type(found).__name__}"
        raise ConfigError(what, "Give a function of lira.Features, a class that is called like one, or a lira.Expert.")
    return Expert(re.split(r"[:.]", name)[-1], checked(found, name))


def checked(act: Callable[[Features], object], name: str) -> Policy:
    """Clip what somebody's policy does to [-1, 1]. Raises `PluginError` when it answers with no action at all."""

    def act_in_range(features: Features) -> Action:
        answer = act(features)
        try:
            linear, angular = np.clip(np.asarray(answer, dtype=np.float64), -1.0, 1.0).tolist()
        except (TypeError, ValueError):
            linear = angular = math.nan
        if not (math.isfinite(linear) and math.isfinite(angular)):
            what = f"the policy '{name}' answered {answer!r}"
            raise PluginError(what, "Let it return two finite numbers in [-1, 1]: (linear, angular).")
        return linear, angular

    return act_in_range
