"""Where the experts' checkpoints lie. Without torch: what is missing is said before anything heavy is loaded."""

from importlib import resources
from pathlib import Path

from hal.errors import ConfigError
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
