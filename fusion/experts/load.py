"""Experts by name: those that come with the project, or a user's own checkpoint by path."""

from lira.fusion.experts.files import expert_path
from lira.fusion.experts.tasks import DEFAULT
from lira.fusion.methods.base import Alone, Expert
from lira.fusion.methods.doubt import Doubtful
from lira.fusion.policies.checkpoint import Checkpoint, load_checkpoint
from lira.fusion.policies.kernel_net import KernelNet
from lira.fusion.policies.networks import Network
from lira.fusion.preprocess import Features
from lira.hal.errors import ConfigError
from lira.hal.messages import Action
from lira.hal.profile import RobotProfile


def load_network(name_or_path: str, profile: RobotProfile, pair: str = DEFAULT) -> tuple[Network, Checkpoint]:
    """Load a policy and check that it fits the robot. Raises `ConfigError` or `StorageError`."""
    path = expert_path(name_or_path, profile, pair)
    network, checkpoint = load_checkpoint(path)
    shape = profile.features
    needs = {"camera": shape.filters == checkpoint.filters, "lidar": shape.bins == checkpoint.bins}
    fits = needs.get(checkpoint.kind, all(needs.values()))
    if not fits:
        raise ConfigError(
            f"{path} was trained for '{checkpoint.profile}' ({checkpoint.bins} beams, {checkpoint.filters} filters), "
            f"not for '{profile.name}' ({shape.bins} beams, {shape.filters} filters)",
            "Use the checkpoint of this profile, or start with the profile it was trained for.",
        )
    return network, checkpoint


def as_expert(name: str, network: Network, cruise: Action | None) -> Expert:
    """Wrap a network as a black box."""

    def act(features: Features) -> Action:
        return network.act(features.scan, features.image)

    return Expert(name, act) if cruise is None else Expert(name, act, cruise)


def load_alone(name_or_path: str, profile: RobotProfile, pair: str = DEFAULT, *, ask: bool = False) -> Alone | Doubtful:
    """Load a policy to drive alone; with `ask` it stands and calls where it doubts. `ConfigError`: it cannot tell."""
    network, checkpoint = load_network(name_or_path, profile, pair)
    act = as_expert(checkpoint.kind, network, checkpoint.cruise).act
    if not ask:
        return Alone(checkpoint.kind, act)
    if not isinstance(network, KernelNet):
        raise ConfigError(f"'{name_or_path}' cannot tell what it does not know", "A novice taught by plus can.")
    return Doubtful(act, network.doubts)


def load_expert(name_or_path: str, profile: RobotProfile, pair: str = DEFAULT) -> Expert:
    """Load an expert; it is named after its sensor."""
    network, checkpoint = load_network(name_or_path, profile, pair)
    return as_expert(checkpoint.kind, network, checkpoint.cruise)
