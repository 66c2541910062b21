"""A Python that has loaded nothing yet, for programs that compute and end. Nobody waits for it as for a server."""

import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

TIMEOUT_S = 180.0


def python(code: str, *words: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a program, and return what came of it."""
    command = [sys.executable, "-c", code, *words]
    return subprocess.run(command, cwd=cwd, check=False, capture_output=True, text=True, timeout=TIMEOUT_S)


def lira(*words: str, block: Collection[str] = (), cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run `lira`; to import a package of `block` fails as if it were not installed."""
    code = f"import sys; sys.modules.update(dict.fromkeys({list(block)!r}))\n"
    return python(f"{code}from lira.tools.cli import main; sys.exit(main({list(words)!r}))", cwd=cwd)
