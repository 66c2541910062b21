"""Begin a project of your own: an expert, a method, a robot, a sensor or a world, with tests that pass.

It writes a folder with the thing itself, a test, a README, a workflow that runs the test at every push and, so that
other folders know it by its name once it is installed, a pyproject.toml with the entry point. Change it step by step,
and keep the tests passing.

examples:
  lira new expert wall                 an expert in the folder wall/
  lira new method far-from-all
  lira new robot rover --into ~/robots
  lira new world my-lab
"""

import argparse
import keyword
import sys
from importlib import resources
from importlib.machinery import PathFinder
from importlib.metadata import PackageNotFoundError, distribution
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template
from typing import NamedTuple

from lira.hal.errors import ConfigError, StorageError
from lira.tools.cli import EXTRAS


class Kind(NamedTuple):
    """What can be begun: its group of entry points, and what in the module the entry point names.

    `part` of the installation is what its tests need.
    """

    door: str
    thing: str
    part: str = "drive"


KINDS = {
    "expert": Kind("experts", "$package"),
    "method": Kind("methods", "Settings", "learn"),
    "robot": Kind("robots", "$title"),
    "sensor": Kind("robots", "robot"),
    "world": Kind("", ""),
}
PROFILE = "thesis-sim"  # what a robot's own profile begins as


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("kind", choices=KINDS, help="what it is to be")
    parser.add_argument("name", help="what it is to be called")
    parser.add_argument("--into", type=Path, default=Path(), metavar="DIR", help="where its folder goes")


def run(args: argparse.Namespace) -> int:
    """Write the project, and say what to do next."""
    folder = args.into / args.name
    written = write_project(args.kind, args.name, folder)
    print("\n".join(str(path) for path in written))
    print(f"\nnext: cd {folder} && python -m pytest; README.md says how to use it")
    return 0


def write_project(kind: str, name: str, folder: Path) -> list[Path]:
    """Write a project of this kind.

    Raises `ConfigError` for a name that cannot be or is ours, `StorageError` if it cannot be written.
    """
    about = KINDS[kind]
    words = {"kind": kind, "name": name, "package": package_of(name), "door": about.door, "part": about.part}
    words["title"] = "".join(part.capitalize() for part in words["package"].split("_"))
    words["thing"] = Template(about.thing).substitute(words)
    if name in names_of_ours(kind):
        remedy = f"Choose another, such as my-{name}: ours would be found in its place."
        raise ConfigError(f"there is a {kind} '{name}' already, which comes with the project", remedy)
    if folder.exists():
        raise ConfigError(f"{folder} is there already", "Choose another name, or another folder with --into.")
    texts = {place(source, words["package"]): source.read_text(encoding="utf-8") for source in templates(kind)}
    project = {path: Template(text).substitute(words) for path, text in texts.items()}
    if kind == "robot":
        profile = resources.files("lira.hal") / "profiles" / f"{PROFILE}.toml"
        project[Path(f"{words['package']}.toml")] = profile.read_text(encoding="utf-8").replace(PROFILE, name)
    try:
        for path, text in project.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise StorageError(f"cannot write {folder}: {error.strerror}", "Choose another folder with --into.") from error
    return sorted(folder / path for path in project)


def names_of_ours(kind: str) -> set[str]:
    """Names by which what comes with the project is found, and what is brought along never is."""
    if kind == "expert":
        from lira.fusion.experts.files import EXPERTS

        return {*EXPERTS, *(f"{name}-expert" for name in EXPERTS)}
    if kind == "method":
        from lira.fusion.methods.presets import ALIASES, METHODS

        return {*METHODS, *ALIASES}
    if kind == "robot":  # its profile has its name
        from lira.hal.profile import known_profiles

        return set(known_profiles())
    if kind == "world":
        from lira.sim_backend.catalogue import known_worlds

        return set(known_worlds())
    return set()


def package_of(name: str) -> str:
    """Return the module's name. Raises `ConfigError` for a name that cannot be one, or that hides another module."""
    package = name.replace("-", "_")
    if keyword.iskeyword(package) or not package.isidentifier() or package != package.lower():
        what = f"'{name}' cannot be the name of a module"
        raise ConfigError(what, "Use small letters, digits and hyphens, such as my-wall.")
    if is_taken(package, name):
        what = f"there is a module or a package '{name}' already, which yours would hide"
        raise ConfigError(what, f"Choose another, such as my-{name}.")
    return package


def is_taken(package: str, name: str) -> bool:
    """Whether Python, this project or what is installed beside it has a module, or a package, of that name."""
    from lira.tools.doctor.machine import BASE

    ours = {each.partition(".")[0] for each in (*BASE, *EXTRAS)} | {"lira", "pytest"}
    if package in sys.stdlib_module_names or package in ours:
        return True
    module = PathFinder.find_spec(package)
    if module is not None and module.origin is not None:  # without an origin it is a mere folder
        return True
    try:
        distribution(name)
    except PackageNotFoundError:
        return False
    return True


def templates(kind: str) -> list[Traversable]:
    """Return the template files of a kind; what all kinds share gives way to what a kind has of its own."""
    root = resources.files("lira.tools") / "templates"
    found = {file.name: file for part in ("common", kind) for file in (root / part).iterdir()}
    return list(found.values())


def place(source: Traversable, package: str) -> Path:
    """Return where in the project a template goes."""
    name = source.name.removesuffix(".tmpl").replace("module", package)
    if name.endswith(".yml"):
        return Path(".github") / "workflows" / name
    return Path("tests") / name if name.startswith("test_") else Path(name)
