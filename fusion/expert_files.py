"""Where the experts' checkpoints lie. Without torch: what is missing is said before anything heavy is loaded.

A *pair* says whose experts are meant: those of a task, by its name, or a user's own, by the folder that holds
`camera.safetensors` and `lidar.safetensors`.
"""

from importlib import resources
from pathlib import Path

from fusion.tasks import DEFAULT, TASKS
from hal.errors import ConfigError
from hal.profile import RobotProfile

SHIPPED = ("camera", "lidar")


def shipped_path(name: str, profile: RobotProfile, task: str = DEFAULT) -> Path:
    """Where the expert that comes with the project lies."""
    owner = TASKS[task].lidar if name == "lidar" else task
    words = [profile.name, *([] if owner == DEFAULT else [owner]), name]
    return Path(str(resources.files("fusion") / "pretrained" / f"{'-'.join(words)}.safetensors"))


def expert_path(name_or_path: str, profile: RobotProfile, pair: str = DEFAULT) -> Path:
    """Where an expert's checkpoint lies. Raises `ConfigError` for a name that does not exist for this robot or pair."""
    if name_or_path.endswith(".safetensors"):
        return Path(name_or_path)
    name = name_or_path.removesuffix("-expert")
    if name not in SHIPPED:
        names = ", ".join(f"{name}-expert" for name in SHIPPED)
        raise ConfigError(f"unknown policy '{name_or_path}'", f"Known: {names}; or give a .safetensors file.")
    train = f"lira train-expert {name} --profile {profile.name}"
    if pair not in TASKS:
        path = Path(pair) / f"{name}.safetensors"
        if not path.exists():
            tasks = ", ".join(TASKS)
            raise ConfigError(
                f"there is no {name} expert {path}", f"Train one: {train} --out {path}; or name a task: {tasks}."
            )
        return path
    path = shipped_path(name, profile, pair)
    if not path.exists():
        words = "" if pair == DEFAULT else f" --task {pair}"
        where = "" if pair == DEFAULT else f" for the task '{pair}'"
        raise ConfigError(
            f"no {name} expert comes with the profile '{profile.name}'{where}", f"Train one with: {train}{words}"
        )
    return path
