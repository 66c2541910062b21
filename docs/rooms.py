"""Draws the map of the code from its imports: which rooms there are, and what each stands on."""

import ast
from collections.abc import Iterable
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGES = ("tools", "fusion", "sim_backend", "robot", "hal")
WIDTH = 17  # of a name

Graph = dict[str, set[str]]


def rooms(package: str) -> dict[str, list[Path]]:
    """Return the rooms of a package: its folders, and the modules beside them, each with its files."""
    found: dict[str, list[Path]] = {}
    for path in sorted((ROOT / package).rglob("*.py")):
        first = path.relative_to(ROOT / package).parts[0].removesuffix(".py")
        if first not in ("__init__", "__main__"):
            found.setdefault(first, []).append(path)
    return found


def imported(paths: Iterable[Path]) -> set[str]:
    """Return the full names of all that some files import."""
    names: set[str] = set()
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def inside(package: str) -> Graph:
    """Return which rooms of a package import which others of it."""
    files = rooms(package)
    graph: Graph = {}
    for room, paths in files.items():
        parts = [name.split(".") for name in imported(paths) if name.startswith(f"lira.{package}.")]
        graph[room] = ({part[2] for part in parts} & set(files)) - {room}
    return graph


def between() -> Graph:
    """Return which packages import which others."""
    graph: Graph = {}
    for package in PACKAGES:
        names = imported((ROOT / package).rglob("*.py"))
        graph[package] = {other for other in PACKAGES if any(name.startswith(f"lira.{other}") for name in names)}
        graph[package].discard(package)
    return graph


def closest(graph: Graph) -> Graph:
    """Leave out what is reached by way of another anyway, so that few arrows say it all."""

    def reach(node: str) -> set[str]:
        return graph[node].union(*(reach(below) for below in graph[node]))

    return {node: below - set().union(*(reach(other) for other in below)) for node, below in graph.items()}


def draw(graph: Graph, indent: str = "") -> list[str]:
    """One line for each node, those that import above those that are imported. Raises `CycleError`."""
    # Sorted first: a set of names has another order in each run, and so would what is drawn from it.
    order = list(TopologicalSorter({node: sorted(graph[node]) for node in graph}).static_order())[::-1]
    near = closest(graph)
    lines = []
    for node in order:
        below = sorted(near[node], key=order.index)
        lines.append(f"{indent}{node:<{WIDTH}}" + (f"-> {', '.join(below)}" if below else ""))
    return [line.rstrip() for line in lines]


def code_map() -> str:
    """Return the whole map, as a block of Markdown."""
    parts = [draw(between())]
    for package in ("fusion", "hal"):
        parts.append([f"{package}/", *draw(inside(package), "  ")])
    text = "\n\n".join("\n".join(part) for part in parts)
    return f"```\n{text}\n```\n"
