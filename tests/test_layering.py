"""Who may import whom. The tables are the architecture; these tests keep them true."""

import ast
import re
import sys
from collections import Counter
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from lira.tools.cli import EXTRAS
from lira.tools.doctor.machine import BASE

ROOT = Path(__file__).parent.parent
MAY_IMPORT = {
    "hal": {"hal"},
    "robot": {"robot", "hal"},
    "sim_backend": {"sim_backend", "hal"},
    "fusion": {"fusion", "hal"},
    "tools": {"tools", "hal", "robot", "sim_backend", "fusion"},
}
# Inside a package: each folder, and each module beside the folders, may import those before it that its row names.
ROOMS = {
    "hal": {
        "errors": set(),
        "misfit": {"errors"},
        "config": {"errors", "misfit"},
        "clock": set(),
        "words": set(),
        "signals": set(),
        "plugins": {"errors"},
        "messages": {"errors"},
        "rmw": {"errors", "messages"},
        "profile": {"errors", "config", "messages"},
        "port": {"messages", "profile"},
        "bus": {"errors", "clock", "words", "messages", "rmw", "profile"},
        "description": {"errors", "config", "messages", "profile"},
        "ros_graph": {"errors", "messages", "rmw", "bus"},
        "safety": {"clock", "messages", "profile", "port"},
        "server": {"errors", "clock", "messages", "profile", "port", "bus", "description", "safety", "signals"},
        "client": {"errors", "clock", "messages", "profile", "port", "bus"},
        "testing": {"messages", "profile", "bus"},
    },
    "fusion": {
        "modalities": set(),
        "preprocess": {"modalities"},
        "inference": {"preprocess"},
        "policies": {"preprocess", "inference"},
        "learning": {"preprocess", "inference", "policies"},
        "methods": {"preprocess", "inference", "policies", "learning"},
        "experts": {"preprocess", "inference", "methods"},
        "control": {"preprocess", "methods"},
        "log": {"preprocess", "learning", "methods", "control"},
        "teaching": {"preprocess", "learning", "methods", "experts", "control", "log"},
        "operator_service": {"methods", "control", "log"},
        "service": {"methods", "control", "log", "operator_service"},
    },
}
MOST_MODULES = 14  # in one folder
NOT_INSTALLED = {"_typeshed", "pytest"}  # for the type checker; whoever loads our plug-in is it
NOT_ON_THE_ROBOT = {"torch", "pybullet", "pygame", "safetensors", "matplotlib"}


@cache
def imports(path: Path, *, top_level_only: bool = False) -> frozenset[str]:
    """Full names of what a file imports; of `from a import b` both `a` and `a.b`."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = set()
    for node in tree.body if top_level_only else ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(found)


def foreign(path: Path, *, top_level_only: bool = False) -> set[str]:
    """Top-level names that a file imports."""
    return {name.split(".")[0] for name in imports(path, top_level_only=top_level_only)}


def rooms(path: Path, package: str) -> set[str]:
    """Which rooms of a package a file imports from."""
    inside = [name.split(".")[2:] for name in imports(path) if name.startswith(f"lira.{package}.")]
    return {name[0] for name in inside} & set(ROOMS[package])


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def name_of(path: Path) -> str:
    return ".".join(["lira", *path.relative_to(ROOT).with_suffix("").parts]).removesuffix(".__init__")


def shown(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_packages_import_only_what_the_table_allows(package):
    for path in modules(package):
        ours = {name.split(".")[1] for name in imports(path) if name.startswith("lira.")}
        assert ours <= MAY_IMPORT[package], f"{shown(path)} imports {ours - MAY_IMPORT[package]}"


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_what_only_a_part_of_the_installation_has_is_known_as_such(package):
    known = {name.split(".")[0] for name in (*BASE, *EXTRAS)} | sys.stdlib_module_names | NOT_INSTALLED | {"lira"}
    for path in modules(package):
        assert foreign(path) <= known, f"{shown(path)}: {foreign(path) - known} is in no table; see tools/cli.py"


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_nothing_imports_a_package_by_the_name_of_its_folder(package):
    for path in [*modules(package), *modules("tests")]:
        assert not foreign(path) & set(MAY_IMPORT), shown(path)


@pytest.mark.parametrize(("package", "room"), [(package, room) for package in ROOMS for room in ROOMS[package]])
def test_rooms_import_only_those_below_them(package, room):
    folder, single = ROOT / package / room, ROOT / package / f"{room}.py"
    for path in sorted(folder.rglob("*.py")) if folder.is_dir() else [single]:
        above = rooms(path, package) - ROOMS[package][room] - {room}
        assert not above, f"{shown(path)} imports {above}"


def test_no_modules_import_each_other_in_a_circle():
    files = {name_of(path): path for package in MAY_IMPORT for path in modules(package)}
    graph = {
        name: {each for each in imports(path) & files.keys() if not name.startswith(f"{each}.")}  # where it lies itself
        for name, path in files.items()
    }
    TopologicalSorter(graph).prepare()  # raises CycleError, which names them


@pytest.mark.parametrize("package", ROOMS)
def test_every_room_stands_in_the_table_behind_those_that_it_may_import(package):
    found = {path.stem for path in (ROOT / package).glob("*.py")} - {"__init__"}
    found |= {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
    assert found == set(ROOMS[package])
    order = list(ROOMS[package])
    for room, below in ROOMS[package].items():
        assert below <= set(order[: order.index(room)]), room


def test_the_readme_of_hal_names_every_module_and_no_other():
    named = Counter(re.findall(r"\b([a-z_]+\.py)\b", (ROOT / "hal" / "README.md").read_text(encoding="utf-8")))
    found = Counter(path.name for path in modules("hal") if path.name != "__init__.py")
    elsewhere = {"rows.py", "mutants.py"}  # of tools/stop_test
    assert named.keys() - elsewhere == found.keys()
    assert not found - named  # rooms have modules of the same name


def test_no_folder_is_a_warehouse():
    # The tests lie as the code does, and who looks for one looks through a folder: those of a room fit the same bound.
    for folder in {path.parent for package in [*MAY_IMPORT, "tests"] for path in modules(package)}:
        count = len([path for path in folder.glob("*.py") if path.name != "__init__.py"])
        assert count <= MOST_MODULES, f"{shown(folder)} has {count} modules"


@pytest.mark.parametrize("package", ["hal", "robot"])
def test_the_robots_side_needs_no_learning_or_simulation_packages(package):
    for path in modules(package):
        assert not foreign(path) & NOT_ON_THE_ROBOT, shown(path)


def test_the_command_line_starts_without_heavy_imports():
    for path in [ROOT / "lira" / "__init__.py", ROOT / "tools" / "__init__.py", ROOT / "tools" / "cli.py"]:
        assert not foreign(path, top_level_only=True) & (NOT_ON_THE_ROBOT | {"numpy", "cv2", "zenoh"}), shown(path)
