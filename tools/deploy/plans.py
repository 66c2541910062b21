"""Makes the plans: the laptop's processes in the environment that runs now, the robot's in one of its own."""

from collections.abc import Sequence
from importlib import resources
from pathlib import Path

import msgspec

from lira.hal.bus.security.keys import VARIABLE, load_keys
from lira.hal.errors import ConfigError
from lira.tools.deploy import packages, units
from lira.tools.deploy.plan import SECRET, File, Plan
from lira.tools.deploy.target import Facts
from lira.tools.joystick.device.rules import PLACE as PAD_PLACE
from lira.tools.joystick.device.rules import rules_text
from lira.tools.lifecycle.services import SETUP, config_folder, target_name, unit_name
from lira.tools.lifecycle.setup import Setup
from lira.tools.lifecycle.table import rows

OLDEST = (3, 11)
ROSBOT_PLACE = "/etc/udev/rules.d/99-lira-rosbot.rules"


def for_laptop(setup: Setup, facts: Facts, python: str, folder: Path, keys: Path | None = None) -> Plan:
    """The laptop's plan. `python` is the interpreter that has the packages, `folder` where recordings and runs go."""
    files = [*_units(setup, facts, python, str(folder)), *_settings(setup, facts, keys)]
    notes: tuple[str, ...] = ()
    if "pad" in setup.processes:
        files.append(File(f"{config_folder(setup.name)}/{Path(PAD_PLACE).name}", rules_text().encode()))
        notes = _udev(setup, PAD_PLACE)
    return Plan(setup.name, setup.processes, tuple(files), notes=notes)


def for_robot(
    setup: Setup,
    facts: Facts,
    brought: Sequence[File],
    keys: Path | None,
    *,
    python3: str = "python3",
    offline: bool = False,
) -> Plan:
    """The plan of the robot's computer. `brought` are the wheels for its environment, which `python3` there makes.

    Raises `ConfigError` for a Python that is too old, and for files and keys that are not there.
    """
    if facts.python < OLDEST:
        found = ".".join(map(str, facts.python)) if any(facts.python) else "none"
        what = f"Python {OLDEST[0]}.{OLDEST[1]} is needed there, and {python3} is {found}"
        raise ConfigError(what, "Install one beside it, and name it: --python python3.11.")
    name = setup.name
    python = f"{facts.home}/{packages.share(name)}/venv/bin/python"
    setup, taken = _with_files(setup, facts)
    rules = (resources.files("lira.tools.deploy") / Path(ROSBOT_PLACE).name).read_bytes()
    files = [*_units(setup, facts, python, facts.home), *_settings(setup, facts, keys), *taken, *brought]
    files.append(File(f"{config_folder(setup.name)}/{Path(ROSBOT_PLACE).name}", rules))
    groups = "sudo usermod -aG dialout,video $USER     # then log in again"
    return Plan(
        name,
        setup.processes,
        tuple(files),
        packages.steps(name, list(brought), python3, offline=offline),
        (f"{packages.share(name)}/venv/",),
        (*_udev(setup, ROSBOT_PLACE), groups),
    )


def _units(setup: Setup, facts: Facts, python: str, folder: str) -> list[File]:
    home = ".config/systemd/user"
    files = [File(f"{home}/{target_name(setup.name)}", units.target(setup).encode())]
    for process in rows(setup):
        text = units.service(process, setup, python, folder, facts.systemd)
        files.append(File(f"{home}/{unit_name(setup.name, process.name)}", text.encode()))
    return files


def _settings(setup: Setup, facts: Facts, keys: Path | None) -> list[File]:
    """The set-up, for `lira status`, and the keys with what names them. Raises `ConfigError` for what are none."""
    files = [File(f"{config_folder(setup.name)}/{SETUP}", msgspec.json.format(msgspec.json.encode(setup)) + b"\n")]
    if keys is None:
        return files
    load_keys(keys)
    bundle = [path for path in sorted(keys.iterdir()) if path.is_file()]
    files += [File(f"{config_folder(setup.name)}/keys/{path.name}", path.read_bytes(), SECRET) for path in bundle]
    variable = f"{VARIABLE}={facts.home}/{config_folder(setup.name)}/keys\n"
    return [*files, File(f"{config_folder(setup.name)}/environment", variable.encode())]


def _with_files(setup: Setup, facts: Facts) -> tuple[Setup, list[File]]:
    """Take along the files of this machine that the robot's words name (settings, a profile), under their new names."""
    words, files = [], list[File]()
    for word in setup.robot:
        local = Path(word)
        if local.suffix != ".toml":
            words.append(word)
        elif local.is_file():
            files.append(File(f"{config_folder(setup.name)}/{local.name}", local.read_bytes()))
            words.append(f"{facts.home}/{files[-1].path}")
        else:
            raise ConfigError(f"there is no {word} here", "Give the path of the file on this machine: it goes along.")
    return msgspec.structs.replace(setup, robot=tuple(words)), files


def _udev(setup: Setup, place: str) -> tuple[str, ...]:
    return (
        f"sudo install -m 644 ~/{config_folder(setup.name)}/{Path(place).name} {place}",
        "sudo udevadm control --reload && sudo udevadm trigger",
    )
