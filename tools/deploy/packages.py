"""The wheels that go to the robot's computer, and how they are installed there."""

import shlex
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import lira
from lira.hal.errors import ConfigError
from lira.tools.deploy.plan import File
from lira.tools.launch.processes import ProcessError

DISTRIBUTION = "lira-rosbot"
OURS = "lira_rosbot-*.whl"
BUILD_S = 300.0
EXTRAS = "robot,drive"
CONSTRAINTS = "constraints.txt"


def share(name: str) -> str:
    """The folder on the robot's computer that holds wheels and environment."""
    return f".local/share/lira/{name}"


def collect(folder: Path | None, name: str, *, build: bool = True) -> list[File]:
    """The wheels of a folder, or ours alone, built from the checkout that runs. Raises `ConfigError`.

    Without `build` ours is but named: the file is empty.
    """
    if folder is None:
        return _ours(name, build=build)
    found = sorted(folder.glob("*.whl")) if folder.is_dir() else []
    if not any(path.match(OURS) for path in found):
        raise ConfigError(f"no {OURS} is in {folder}", f"Make it: pip wheel --wheel-dir {folder} lira-rosbot[robot].")
    files = [File(f"{share(name)}/wheels/{path.name}", path.read_bytes()) for path in found]
    if (folder / CONSTRAINTS).is_file():
        files.append(File(f"{share(name)}/wheels/{CONSTRAINTS}", (folder / CONSTRAINTS).read_bytes()))
    return files


def steps(name: str, files: list[File], python3: str, *, offline: bool) -> tuple[str, ...]:
    """Lines of the shell that make the environment, or bring it up to date.

    `python3` is the interpreter there to make it with. Ours is put in anew even if its version is the same; what it
    needs comes from the folder first, `offline` only from there.
    """
    wheels, python = f"{share(name)}/wheels", f"{share(name)}/venv/bin/python"
    ours = next(file.path for file in files if Path(file.path).match(OURS))
    constraints = f"{wheels}/{CONSTRAINTS}"
    limits = f" --constraint {constraints}" if any(file.path == constraints for file in files) else ""
    source = f"--find-links {wheels}{' --no-index' if offline else ''}"
    pip = f"{python} -m pip install --quiet --disable-pip-version-check"
    return (
        f"[ -x {python} ] || {shlex.quote(python3)} -m venv {share(name)}/venv",
        f"{pip} {source}{limits} '{ours}[{EXTRAS}]'",
        f"{pip} --no-deps --force-reinstall {ours}",
    )


def _ours(name: str, *, build: bool) -> list[File]:
    root = Path(lira.__file__).resolve().parent.parent
    if not (root / "pyproject.toml").is_file():
        raise ConfigError("this installation has no wheel of itself to copy", "Give a folder that has: --wheels DIR.")
    limits = File(f"{share(name)}/wheels/{CONSTRAINTS}", (root / CONSTRAINTS).read_bytes())
    if not build:
        return [File(f"{share(name)}/wheels/{OURS.replace('*', f'{version(DISTRIBUTION)}-py3-none-any')}", b""), limits]
    with tempfile.TemporaryDirectory() as made:
        command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", made, str(root)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=BUILD_S, check=False)
        if done.returncode:
            raise ProcessError(f"the wheel cannot be built: {done.stderr.strip()}", "Give one that is: --wheels DIR.")
        found = [File(f"{share(name)}/wheels/{path.name}", path.read_bytes()) for path in Path(made).glob(OURS)]
    return [*found, limits]
