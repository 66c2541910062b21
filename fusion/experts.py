"""Experts by name: those that come with the project, or a user's own checkpoint by path."""

from importlib import resources
from pathlib import Path

from fusion.checkpoint import Checkpoint, load_checkpoint
from fusion.method import Expert
from fusion.networks import Network
from fusion.preprocess import Features
from hal.errors import ConfigError
from hal.messages import Action
from hal.profile import RobotProfile

SHIPPED = ("camera", "lidar")


def shipped_path(name: str, profile: RobotProfile) -> Path:
    """Where the expert that comes with the project lies."""
    return Path(str(resources.files("fusion") / "pretrained" / f"{profile.name}-{name}.safetensors"))


def expert_path(name_or_path: str, profile: RobotProfile) -> Path:
    """Where an expert's checkpoint lies. Raises `ConfigError` for a name that does not exist for this robot."""
    if name_or_path.endswith(".safetensors"):
        return Path(name_or_path)
    name = name_or_path.removesuffix("-expert")
    path = shipped_path(name, profile)
    if name not in SHIPPED:
        names = ", ".join(f"{name}-expert" for name in SHIPPED)
        raise ConfigError(f"unknown policy '{name_or_path}'", f"Known: {names}; or give a .safetensors file.")
    if not path.exists():
        raise ConfigError(
            f"no {name} expert comes with the profile '{profile.name}'",
            f"Train one with: lira train-expert {name} --profile {profile.name}",
        )
    return path


def load_network(name_or_path: str, profile: RobotProfile) -> tuple[Network, Checkpoint]:
    """Load a policy and check that it fits the robot. Raises `ConfigError` or `StorageError`."""
    path = expert_path(name_or_path, profile)
    network, checkpoint = load_checkpoint(path)
    shape = profile.features
    needs = {"camera": shape.filters == checkpoint.filters, "lidar": shape.bins == checkpoint.bins}
    fits = all(needs.values()) if checkpoint.kind == "fusion" else needs[checkpoint.kind]
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


def load_expert(name_or_path: str, profile: RobotProfile) -> Expert:
    """Load an expert; it is named after its sensor."""
    network, checkpoint = load_network(name_or_path, profile)
    return as_expert(checkpoint.kind, network, checkpoint.cruise)
