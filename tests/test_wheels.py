"""Every part installs without a compiler: the package index has a wheel of each package it brings, for each Python and
processor. pip is asked, through whatever index it is set to; nothing is downloaded. Without an index it is skipped.
"""

import json
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
USERS = [extra for extra in PROJECT["optional-dependencies"] if extra not in ("dev", "docs")]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
PROCESSORS = ("x86_64", "aarch64")
GLIBC = ("_2_28", "_2_27", "_2_26", "_2_24", "_2_17", "2014", "_2_12", "_2_5", "1")  # Debian 10 and newer
SOURCE_ONLY = {"openni"}  # pure Python, which pip builds without a compiler
GPU = re.compile(r"nvidia-|cuda-|triton")  # of the default build of torch; the CPU build has none
TIMEOUT_S = 240


@dataclass
class Index:
    """What pip's index said: of each package, what it requires. The versions are those of constraints.txt."""

    requires: dict[str, list[str]] = field(default_factory=dict)
    everywhere: set[str] = field(default_factory=set)  # pure Python, so that one answer is enough
    stable: dict[tuple[str, str], int] = field(default_factory=dict)  # on a processor, from Python 3.x on (abi3)

    def knows(self, name, python, processor):
        """Whether it was said already that a package has a wheel there."""
        return name in self.everywhere or self.stable.get((name, processor), 99) <= int(python.split(".")[1])

    def lacks(self, names, python, processor):
        """Which of these have no wheel; notes what the others require. One question for all, if all have one."""
        names = sorted(name for name in names if not self.knows(name, python, processor))
        if not names:
            return set()
        answer = self._ask(names, python, processor)
        if answer is not None:
            return set()
        if len(names) == 1:
            return set(names)
        middle = len(names) // 2
        return self.lacks(names[:middle], python, processor) | self.lacks(names[middle:], python, processor)

    def _ask(self, names, python, processor):
        abi = "cp" + python.replace(".", "")
        command = [
            sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--no-deps", "--ignore-installed",
            "--only-binary=:all:", "--report", "-", "--target", "nowhere", "--disable-pip-version-check",
            "--constraint", str(ROOT / "constraints.txt"), "--implementation", "cp", "--python-version", python,
        ]  # fmt: skip
        command += [word for each in (abi, "abi3", "none") for word in ("--abi", each)]
        command += [word for each in GLIBC for word in ("--platform", f"manylinux{each}_{processor}")]
        done = subprocess.run(
            [*command, *names], check=False, capture_output=True, text=True, timeout=TIMEOUT_S, cwd=ROOT
        )
        if done.returncode:
            if re.search(r"NewConnectionError|ConnectTimeout|Name or service not known|ProxyError", done.stderr):
                pytest.skip("no package index answers")
            return None
        report = json.loads(done.stdout[done.stdout.index("{") :])
        for each in report["install"]:
            name = canonicalize_name(each["metadata"]["name"])
            self.requires[name] = each["metadata"].get("requires_dist", [])
            *_, abi, platform = each["download_info"]["url"].removesuffix(".whl").split("-")
            if platform == "any":
                self.everywhere.add(name)
            elif abi == "abi3":
                self.stable[name, processor] = int(python.split(".")[1])
        return report


def wanted(lines, environment, extras=("",)):
    """Requirements that hold on a machine; those of the project's own parts are followed."""
    for line in lines:
        requirement = Requirement(line)
        marker = requirement.marker
        if marker is not None and not any(marker.evaluate({**environment, "extra": extra}) for extra in extras):
            continue
        if canonicalize_name(requirement.name) == PROJECT["name"]:
            for extra in requirement.extras:
                yield from wanted(PROJECT["optional-dependencies"][extra], environment)
        else:
            yield requirement


def environment_of(python, processor):
    return {
        "python_version": python, "python_full_version": f"{python}.0", "platform_machine": processor,
        "sys_platform": "linux", "platform_system": "Linux", "os_name": "posix", "implementation_name": "cpython",
        "platform_python_implementation": "CPython",
    }  # fmt: skip


def closure(index, lines, environment):
    """All packages that requirements bring on a machine, as far as it is known by now what they require."""
    seen: dict[str, set[str]] = {}
    waiting = list(wanted(lines, environment))
    while waiting:
        requirement = waiting.pop()
        name = canonicalize_name(requirement.name)
        extras = {"", *requirement.extras} | seen.get(name, set())
        if name in SOURCE_ONLY or GPU.match(name) or extras == seen.get(name):
            continue
        seen[name] = extras
        waiting += wanted(index.requires.get(name, []), environment, extras)
    return set(seen)


def check(index, lines, python, processor):
    """All packages that requirements bring on a machine, and those without a wheel for it."""
    asked: set[str] = set()
    missing: set[str] = set()
    while new := closure(index, lines, environment_of(python, processor)) - asked:
        missing |= index.lacks(new, python, processor)
        asked |= new
    return asked, missing


INDEX = Index()  # for all tests: what a package requires is asked once


@pytest.mark.parametrize("processor", PROCESSORS)
@pytest.mark.parametrize("python", PYTHONS)
def test_every_part_installs_from_wheels(python, processor):
    lines = [*PROJECT["dependencies"], *(line for extra in USERS for line in PROJECT["optional-dependencies"][extra])]
    packages, missing = check(INDEX, lines, python, processor)
    assert {"numpy", "eclipse-zenoh", "torch", "pyserial", "av", "pygame-ce"} <= packages
    assert not missing, f"no wheel for Python {python} on {processor}: {', '.join(sorted(missing))}"


def test_a_package_without_a_wheel_would_be_noticed():
    assert INDEX.lacks({"evdev", "numpy"}, "3.14", "aarch64") == {"evdev"}


def test_what_is_only_there_as_source_is_pure():
    """A compiler is not needed for what pip builds from source here."""
    direct = {canonicalize_name(Requirement(line).name) for line in PROJECT["optional-dependencies"]["robot"]}
    assert direct >= SOURCE_ONLY
    openni = pytest.importorskip("openni")
    folder = Path(openni.__file__).parent
    assert not [path for path in folder.rglob("*") if path.suffix in (".so", ".pyd", ".c")]
