"""Doors for what is not ours: an object by name, from the project, an installed package or a user's own module.

Wherever a name is expected it is looked up in the same order: what comes with the project, the entry points of
installed packages, and `module:object` or `file.py:object`, with the working directory as the last place to look in.
Errors in somebody's plug-in are theirs by name: see `blame`.
"""

import importlib
import importlib.util
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from lira.hal.errors import ConfigError, PluginError

# Module of a plug-in -> what was asked for in it: the object's name, and words such as "policy 'mylab.m:wall'".
_owners: dict[str, dict[str, str]] = {}


@dataclass(frozen=True, slots=True)
class Door:
    """One kind of thing that can be brought along: what it is called, and the entry points that offer it.

    `more` says what else may be given where its name is expected.
    """

    kind: str
    group: str
    more: str = ""

    def find(self, name: str, shipped: Mapping[str, object]) -> object:
        """Return the object of that name.

        Raises `ConfigError` for a name that nobody knows, `PluginError` for a plug-in that cannot be loaded.
        """
        if name in shipped:
            return shipped[name]
        entries = self.entries()
        target = entries.get(name, name)
        if not all(target.rpartition(":")):
            remedy = f"Known: {', '.join([*shipped, *entries])}; or give one of your own as MODULE:OBJECT{self.more}."
            raise ConfigError(f"unknown {self.kind} '{name}'", remedy)
        return _load(f"{self.kind} '{name}'", target)

    def entries(self) -> dict[str, str]:
        """Return what installed packages offer: names, and where each lies as `module:object`."""
        from importlib.metadata import entry_points  # takes a while to load

        return {entry.name: entry.value for entry in entry_points(group=self.group)}


EXPERTS = Door("policy", "lira.experts", " or a .safetensors file")
METHODS = Door("method", "lira.methods")
ROBOTS = Door("robot", "lira.robots")
EXPERIMENTS = Door("experiment", "lira.experiments")


def blame(error: BaseException) -> PluginError | None:
    """Return the error as that of the plug-in in whose code it was raised, or that led there; None if there is none."""
    frames = list(traceback.walk_tb(error.__traceback__))
    entered = {frame.f_code.co_qualname.split(".")[0] for frame, _ in frames}
    for frame, line in reversed(frames):
        asked = _asked_for(str(frame.f_globals.get("__name__", "")))
        if asked:
            owners = [owner for name, owner in asked if name.split(".")[0] in entered] or [owner for _, owner in asked]
            where = traceback.FrameSummary(frame.f_code.co_filename, line, frame.f_code.co_name)
            place = f"{where.filename}, line {line}, in {where.name}: {where.line}"
            return _fault(" or the ".join(owners), error, place)
    return None


def _asked_for(module: str) -> list[tuple[str, str]]:
    """Return what was asked for in a module, names and words; in its neighbours, if nothing was in this one."""
    if module in _owners:
        return list(_owners[module].items())
    top = module.split(".")[0]
    return [each for name, owners in _owners.items() if name.split(".")[0] == top for each in owners.items()]


def _fault(owner: str, error: BaseException, where: str) -> PluginError:
    return PluginError(f"the {owner} failed: {type(error).__name__}: {error}", f"Mend it there: {where}")


def _load(owner: str, target: str) -> object:
    """Import what `module:object` names. The working directory comes last, so that it hides nothing installed."""
    place, _, attribute = target.rpartition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    module = _import(owner, place, attribute)
    if hasattr(module, "__path__") and getattr(module, "__file__", None) is None:
        raise _mere_folder(owner, place, attribute, Path(next(iter(module.__path__))))
    found: object = module
    for part in attribute.split("."):
        if not hasattr(found, part):
            names = ", ".join(name for name in vars(module) if not name.startswith("_")) or "nothing"
            raise ConfigError(f"{place} has no '{attribute}', which is to be the {owner}", f"It has: {names}.")
        found = getattr(found, part)
    return found


def _mere_folder(owner: str, place: str, attribute: str, folder: Path) -> ConfigError:
    """Say that what was found is a folder, which Python takes for a package without anything in it."""
    here = Path.cwd()
    shown = folder.relative_to(here) if folder.is_relative_to(here) else folder
    modules = sorted(path.name for path in folder.glob("*.py"))
    module = f"{folder.name}.py" if f"{folder.name}.py" in modules or not modules else modules[0]
    remedy = f"Work in that folder, with {Path(module).stem}:{attribute}, or give {shown / module}:{attribute}."
    return ConfigError(f"'{place}' is a folder and no module, and {owner} is to be in one", remedy)


def _import(owner: str, place: str, attribute: str) -> ModuleType:
    """Import a module by name, or from a file. Raises `ConfigError` if there is none, `PluginError` if it fails."""
    name = f"plugin_{Path(place).stem}" if place.endswith(".py") else place
    if name.split(".")[0] != "lira":
        _owners.setdefault(name, {})[attribute] = owner
    try:
        return importlib.import_module(name) if name == place else _from_file(name, Path(place).resolve())
    except ModuleNotFoundError as error:
        if error.name is None or not f"{name}.".startswith(f"{error.name}."):  # it is there, and lacks another
            raise blame(error) or _fault(owner, error, place) from error
        remedy = f"Install the package it is in, or work in the folder where it lies; this is {Path.cwd()}."
        raise ConfigError(f"there is no module '{place}' with the {owner}", remedy) from error
    except SyntaxError as error:
        raise _fault(owner, error, f"{error.filename}, line {error.lineno}: {(error.text or '').strip()}") from error
    except Exception as error:
        raise blame(error) or _fault(owner, error, place) from error


def _from_file(name: str, path: Path) -> ModuleType:
    """Import a module from its file, once; it may import its neighbours."""
    loaded = sys.modules.get(name)
    if loaded is not None and loaded.__file__ == str(path):
        return loaded
    spec = importlib.util.spec_from_file_location(name, path) if path.is_file() else None
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(f"{path} is no module", name=name)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
