"""Where the experts' checkpoints lie. Without torch: what is missing is said before anything heavy is loaded.

A robot has an expert for each sensor that it learns from, called by the sensor. A *pair* (of two, as a rule) says whose
are meant: those of a task, by its name; others of that task, as TASK@SEED, trained when an experiment needs them; or a
user's own, by the folder that holds `camera.safetensors`, `lidar.safetensors` and whatever else the robot learns from.
"""

from collections.abc import Collection
from importlib import resources
from pathlib import Path

from lira.fusion.experts.tasks import DEFAULT, TASKS
from lira.fusion.preprocess import MODALITIES, modalities_of
from lira.hal.errors import ConfigError
from lira.hal.profile import RobotProfile, known_profiles, load_profile

EXPERTS = tuple(row.sensor for row in MODALITIES.values())
TRAINED = Path("runs") / "experts"
SUFFIX = ".safetensors"


def experts_of(profile: RobotProfile) -> tuple[str, ...]:
    """Names of the experts that a robot has. Raises `ConfigError` for a profile with inputs that it does not have."""
    return tuple(row.sensor for row in modalities_of(profile))


def check_learned(name: str, profile: RobotProfile) -> None:
    """Raise `ConfigError` if a robot of this profile does not learn from the sensor of that expert."""
    if name in experts_of(profile):
        return
    inputs = " and ".join(profile.features.inputs)
    what = f"a robot of the profile '{profile.name}' has no {name} expert: it learns from {inputs}"
    raise ConfigError(what, who_has([name]))


def who_has(sensors: Collection[str]) -> str:
    """Say with which profile a robot learns from all of these sensors."""
    known = [name for name in known_profiles() if set(sensors) <= set(experts_of(load_profile(name)))]
    if not known:
        return f"Take a profile of your own whose robot learns from {' and '.join(sensors)}."
    return f"With --profile {' or '.join(known)} the robot learns from {' and '.join(sensors)}."


def tasks_with(name: str) -> list[str]:
    """Tasks that an expert is trained for: those of robots that learn from its sensor, unless they borrow it."""
    own = [task for task in TASKS.values() if task.owner(name) == task.name]
    return [task.name for task in own if name in experts_of(load_profile(task.profile))]


def seeded(pair: str) -> tuple[str, int] | None:
    """Take TASK@SEED apart; None for a pair of another kind. Raises `ConfigError` for what is no task or no seed."""
    task, at, seed = pair.partition("@")
    if not at or "/" in pair:
        return None
    if task not in TASKS or not seed.isdecimal():
        raise ConfigError(f"'{pair}' is no pair of experts", f"Give one like {DEFAULT}@1; tasks: {', '.join(TASKS)}.")
    return task, int(seed)


def check_pair(pair: str) -> None:
    """Raise `ConfigError` for what is no pair of any robot: no task, no TASK@SEED, and no folder with an expert."""
    if pair in TASKS or seeded(pair) is not None:
        return
    if not any((Path(pair) / f"{name}{SUFFIX}").is_file() for name in EXPERTS):
        remedy = (
            f"Give a folder with camera.safetensors and lidar.safetensors, a task ({', '.join(TASKS)}), or TASK@SEED."
        )
        raise ConfigError(f"there are no experts in {pair}", remedy)


def folder_of(pair: str) -> Path:
    """Where the files of a pair lie that does not come with the project. Raises `ConfigError`."""
    found = seeded(pair)
    return Path(pair) if found is None else TRAINED / f"{found[0]}-{found[1]}"


def shipped_path(name: str, profile: RobotProfile, task: str = DEFAULT) -> Path:
    """Where the expert that comes with the project lies."""
    owner = TASKS[task].owner(name)
    robot = TASKS[owner].profile if profile.name == TASKS[task].profile else profile.name
    words = [robot, *([] if owner == DEFAULT else [owner]), name]
    return Path(str(resources.files("lira.fusion") / "pretrained" / f"{'-'.join(words)}.safetensors"))


def expert_path(name_or_path: str, profile: RobotProfile, pair: str = DEFAULT) -> Path:
    """Where an expert's checkpoint lies. Raises `ConfigError` for a name that does not exist for this robot or pair."""
    if name_or_path.endswith(SUFFIX):
        return Path(name_or_path)
    name = name_or_path.removesuffix("-expert")
    if name not in EXPERTS:
        names = ", ".join(f"{name}-expert" for name in EXPERTS)
        raise ConfigError(f"unknown policy '{name_or_path}'", f"Known: {names}; or give a .safetensors file.")
    train = f"lira train-expert {name} --profile {profile.name}"
    if pair not in TASKS:
        path = folder_of(pair) / f"{name}{SUFFIX}"
        if not path.exists():
            check_learned(name, profile)
            known = ", ".join(TASKS)
            what = f"there is no {name} expert {path}"
            raise ConfigError(what, f"Train one: {train} --out {path}; or name a task: {known}; or TASK@SEED.")
        return path
    path = shipped_path(name, profile, pair)
    if not path.exists():
        check_learned(name, profile)
        if TASKS[pair].owner(name) not in tasks_with(name):
            remedy = f"Take that of another with {' or '.join(f'--experts {task}' for task in tasks_with(name))}."
            raise ConfigError(f"the task '{pair}' has no {name} expert", remedy)
        words = "" if pair == DEFAULT else f" --task {pair}"
        where = "" if pair == DEFAULT else f" for the task '{pair}'"
        raise ConfigError(
            f"no {name} expert comes with the profile '{profile.name}'{where}", f"Train one with: {train}{words}"
        )
    return path
