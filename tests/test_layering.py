"""Who may import whom. The table is the architecture; this test keeps it true."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MAY_IMPORT = {
    "hal": {"hal"},
    "robot": {"robot", "hal"},
    "sim_backend": {"sim_backend", "hal"},
    "fusion": {"fusion", "hal"},
    "tools": {"tools", "hal", "robot", "sim_backend", "fusion"},
}
NOT_ON_THE_ROBOT = {"torch", "pybullet", "pygame", "safetensors", "matplotlib"}


def imports(path: Path, *, top_level_only: bool = False) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = tree.body if top_level_only else list(ast.walk(tree))
    found = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module.split(".")[0])
    return found


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_packages_import_only_what_the_table_allows(package):
    for path in modules(package):
        ours = imports(path) & set(MAY_IMPORT)
        assert ours <= MAY_IMPORT[package], f"{path.relative_to(ROOT)} imports {ours - MAY_IMPORT[package]}"


@pytest.mark.parametrize("package", ["hal", "robot"])
def test_the_robots_side_needs_no_learning_or_simulation_packages(package):
    for path in modules(package):
        assert not imports(path) & NOT_ON_THE_ROBOT, path


def test_the_command_line_starts_without_heavy_imports():
    for path in [ROOT / "tools" / "__init__.py", ROOT / "tools" / "cli.py"]:
        assert not imports(path, top_level_only=True) & (NOT_ON_THE_ROBOT | {"numpy", "cv2", "zenoh"}), path
