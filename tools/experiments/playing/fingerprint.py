"""What an outcome depends on beside its trial: the code that ran, the world, the robot, the experts' weights."""

import ast
import hashlib
from functools import cache
from pathlib import Path

import msgspec

import lira
from lira.fusion.experts.files import expert_path, experts_of
from lira.fusion.experts.tasks import TASKS, task_of
from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world

ROOT = Path(lira.__file__).parent
START = "lira.tools.experiments.trial"


@cache
def fingerprint(world: str, pair: str, source: bytes = b"") -> str:
    """Return 16 hex digits that change with anything a trial here, with these experts, could come out differently for.

    Of the code, what `START` imports counts: what each file does, not where it lies nor what it imports, so that moving
    modules changes nothing; of a method of somebody's own its `source`. The robot is that of the world's task.
    Raises `ConfigError` if an expert is not there.
    """
    profile = load_profile(TASKS[task_of(world)].profile)
    parts = [msgspec.json.encode(each) for each in (load_world(world), profile)]
    parts += [expert_path(name, profile, pair).read_bytes() for name in experts_of(profile)]
    parts += [source] if source else []
    return hashlib.sha256(_code() + _digests(parts)).hexdigest()[:16]


@cache
def _code() -> bytes:
    """Digests of what `START` imports: to parse it all takes half a second, and no world or expert changes it."""
    return _digests(sorted(filter(None, map(code, sources(START)))))


def _digests(parts: list[bytes]) -> bytes:
    return b"".join(hashlib.sha256(part).digest() for part in parts)


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
    top, *rest = name.split(".")
    if top != lira.__name__:
        return None
    path = ROOT.joinpath(*rest)
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
    """Return what a file does: its syntax tree without docstrings and imports; nothing if it does nothing else."""
    tree = _tree(path)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            node.body = [each for each in body if not isinstance(each, ast.Import | ast.ImportFrom)]
    return ast.dump(tree).encode() if tree.body else b""


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))
