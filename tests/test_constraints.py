"""`constraints.txt` pins all that a developer's installation brings, or set-up is not what was tested."""

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parent.parent
EXTRA = "dev"


def pinned():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pairs = [line.split("==") for line in lines if "==" in line]
    return {canonicalize_name(name): version for name, version in pairs}


def brought(name, extras, seen):
    """Names and versions of what a package of this installation needs, down to the last."""
    for line in distribution(name).requires or []:
        needed = Requirement(line)
        key = (canonicalize_name(needed.name), frozenset(needed.extras))
        wanted = needed.marker is None or any(needed.marker.evaluate({"extra": extra}) for extra in ["", *extras])
        if wanted and key not in seen:
            seen.add(key)
            brought(needed.name, needed.extras, seen)
    return {name for name, _ in seen}


def test_whatever_a_developers_installation_brings_is_pinned():
    try:
        names = brought("lira-rosbot", [EXTRA], set()) - {"lira-rosbot"}
    except PackageNotFoundError as absent:
        pytest.skip(f"{absent} is not installed")
    assert len(names) > 50
    missing = sorted(names - set(pinned()))
    assert not missing, f"add to constraints.txt: {missing}"
