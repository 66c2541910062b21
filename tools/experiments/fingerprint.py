"""What an outcome depends on beside its trial: the code that ran, the world, the robot, the experts' weights."""

import ast
import hashlib
from functools import cache
from pathlib import Path

import msgspec

from fusion.expert_files import SHIPPED, expert_path
from fusion.tasks import TASKS, task_of
from hal.profile import load_profile
from sim_backend.catalogue import load_world

ROOT = Path(__file__).parents[2]
START = "tools.experiments.trial"
OURS = ("hal", "fusion", "sim_backend", "tools")


@cache
def fingerprint(world: str, pair: str) -> str:
    """Return 16 hex digits that change with anything a trial here, with these experts, could come out differently for.

    Of the code, what `START` imports counts, without comments and docstrings; the robot is that of the world's task.
    Raises `ConfigError` for an expert that is not there.
    """
    profile = load_profile(TASKS[task_of(world)].profile)
    parts = [code(path) for path in sources(START)]
    parts += [msgspec.json.encode(each) for each in (load_world(world), profile)]
    parts += [expert_path(name, profile, pair).read_bytes() for name in SHIPPED]
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()[:16]


def sources(start: str) -> list[Path]:
    """Files of this project that a module imports, directly or not, in a fixed order."""
    found: set[Path] = set()
    waiting = [start]
    while waiting:
        name = waiting.pop()
        path = module_file(name)
        if path is None or path in found:
            continue
        found.add(path)
        waiting += imported(path)
    return sorted(found)


def module_file(name: str) -> Path | None:
    """Where a module of ours lies; None for what is none."""
    if name.split(".")[0] not in OURS:
        return None
    path = ROOT.joinpath(*name.split("."))
    return next((each for each in (path.with_suffix(".py"), path / "__init__.py") if each.is_file()), None)


def imported(path: Path) -> list[str]:
    """Names that could be modules, of all imports in a file."""
    names: list[str] = []
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return names


def code(path: Path) -> bytes:
    """Return what a file does: its syntax tree without docstrings."""
    tree = _tree(path)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return ast.dump(tree).encode()


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))
