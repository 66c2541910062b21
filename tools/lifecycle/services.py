"""The same processes as services of systemd, which `lira deploy` makes: their names, and how they are."""

import os
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

from lira.hal.config import load_json
from lira.tools.lifecycle.records import ProcessState, State
from lira.tools.lifecycle.restart import Phase
from lira.tools.lifecycle.setup import Setup
from lira.tools.lifecycle.table import rows

SETUP = "setup.json"
ASK_S = 5.0
ASKED = ("Id", "ActiveState", "MainPID", "NRestarts", "StatusText", "StateChangeTimestampMonotonic", "Result")
PHASES = {"active": Phase.RUNS, "activating": Phase.STARTS, "deactivating": Phase.STOPPED, "inactive": Phase.STOPPED}
Ask = Callable[[Sequence[str]], str]


def unit_name(setup_name: str, process: str) -> str:
    """Name of a process's unit."""
    return f"lira-{setup_name}-{process}.service"


def target_name(setup_name: str) -> str:
    """Name of what holds them together."""
    return f"lira-{setup_name}.target"


def config_folder(setup_name: str) -> str:
    """Where their settings are, below the home folder."""
    return f".config/lira/{setup_name}"


def ask_systemd(words: Sequence[str]) -> str:
    """What `systemctl --user` says; nothing where there is none that answers."""
    try:
        done = subprocess.run(["systemctl", "--user", *words], capture_output=True, timeout=ASK_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.decode(errors="replace") if done.returncode == 0 else ""


def look(name: str, ask: Ask = ask_systemd) -> State | None:
    """How they are; None if none was made for this name, or all of them are stopped. Raises `ConfigError`."""
    path = Path(os.environ.get("HOME") or Path.home()) / config_folder(name) / SETUP
    if not path.exists():
        return None
    setup = load_json(path, Setup)
    names = [unit_name(name, process.name) for process in rows(setup)]
    found = parse(ask(["show", f"--property={','.join(ASKED)}", *names]))
    processes = tuple(
        _state(found[unit_name(name, process.name)], process.name, process.does)
        for process in rows(setup)
        if unit_name(name, process.name) in found
    )
    if all(process.phase is Phase.STOPPED for process in processes):
        return None
    return State(setup, 0, min(process.since_s for process in processes), processes)


def parse(text: str) -> dict[str, dict[str, str]]:
    """The properties of each unit, by its name."""
    blocks = [dict(line.split("=", 1) for line in block.splitlines() if "=" in line) for block in text.split("\n\n")]
    return {block["Id"]: block for block in blocks if "Id" in block}


def _state(unit: dict[str, str], name: str, does: str) -> ProcessState:
    since, pid, restarts = (unit.get(key, "") for key in ("StateChangeTimestampMonotonic", "MainPID", "NRestarts"))
    starts = (int(restarts) if restarts.isdecimal() else 0) + 1
    result = unit.get("Result", "success")
    return ProcessState(
        name,
        does,
        PHASES.get(unit.get("ActiveState", ""), Phase.WAITS),
        int(since) / 1e6 if since.isdecimal() else 0.0,
        int(pid) if pid.isdecimal() and pid != "0" else None,
        starts,
        unit.get("StatusText", ""),
        "" if result == "success" else result,
    )
