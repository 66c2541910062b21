"""Who else has a serial port open. A program that takes no lock, such as the vendors' own, shares it unasked: each then
gets a part of what comes. Linux tells (`/proc`), of programs of the same user at least.
"""

import contextlib
import os
import re
from pathlib import Path

PROC = Path("/proc")


def other_users(path: str, proc: Path = PROC) -> list[str]:
    """Names and numbers of other processes that have the device at `path` open; empty where nobody can tell."""
    real = os.path.realpath(path)
    users = []
    for process in proc.glob("[0-9]*"):
        if process.name == str(os.getpid()):
            continue
        with contextlib.suppress(OSError, ValueError):
            opened = {link.name: _target(link) for link in (process / "fd").iterdir()}
            if real in opened.values() and not _is_other_end(process, opened, real):
                name = (process / "comm").read_text(encoding="utf-8", errors="replace").strip()
                users.append(f"{name} ({process.name})")
    return sorted(users)


def _target(link: Path) -> str:
    with contextlib.suppress(OSError):
        return str(link.readlink())
    return ""


def _is_other_end(process: Path, opened: dict[str, str], real: str) -> bool:
    """Whether a process is the device itself: it holds the other end of a pseudo-terminal."""
    terminal = re.fullmatch(r"/dev/pts/(\d+)", real)
    if terminal is None:
        return False
    for number, target in opened.items():
        if target.endswith("/ptmx"):
            with contextlib.suppress(OSError):
                info = (process / "fdinfo" / number).read_text(encoding="utf-8", errors="replace")
                if re.search(rf"^tty-index:\s*{terminal[1]}$", info, flags=re.MULTILINE):
                    return True
    return False
