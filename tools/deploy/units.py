"""systemd's user units of the processes in the list: a service each, and a target that holds them together. Pure."""

from collections.abc import Sequence

from lira.tools.lifecycle.restart import FIRST_S, LONGEST_S, READY_S
from lira.tools.lifecycle.services import config_folder, target_name, unit_name
from lira.tools.lifecycle.setup import Setup
from lira.tools.lifecycle.table import Process, rows

STOP_S = 20
STEPS = 5  # from the shortest pause to the longest: each twice the one before
WITH_STEPS = 254  # systemd's version that knows them


def quoted(words: Sequence[str]) -> str:
    """A command line as `ExecStart=` reads it: nothing in it is expanded."""
    return " ".join(_quoted(word) for word in words)


def _quoted(word: str) -> str:
    escaped = word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    plain = escaped == word and word and not any(character.isspace() or character in "';" for character in word)
    return word if plain else f'"{escaped}"'


def service(process: Process, setup: Setup, python: str, folder: str, systemd: int) -> str:
    """A process's unit: it says itself that it is ready and lives, and is started again after pauses that grow.

    `python` is the interpreter, `folder` where it runs, and `systemd` the version there, 0 if it is not known.
    """
    robots = [row.name for row in rows(setup) if row.is_robot and not process.is_robot]
    after = [f"After={' '.join(unit_name(setup.name, robot) for robot in robots)}"] if robots else []
    grows = [f"RestartSteps={STEPS}", f"RestartMaxDelaySec={LONGEST_S:g}"] if systemd >= WITH_STEPS else []
    pause_s = FIRST_S if grows else FIRST_S * 4
    lines = [
        "[Unit]",
        f"Description=lira: {process.does} ('{setup.name}')".replace("%", "%%"),
        f"PartOf={target_name(setup.name)}",
        *after,
        "StartLimitIntervalSec=0",
        "",
        "[Service]",
        "Type=notify",
        "NotifyAccess=main",
        f"ExecStart={quoted(process.command(setup, python))}",
        f"WorkingDirectory={folder.replace('%', '%%')}",
        f"EnvironmentFile=-%h/{config_folder(setup.name)}/environment",
        "Environment=PYTHONUNBUFFERED=1",
        f"TimeoutStartSec={READY_S:g}",
        f"WatchdogSec={process.patience_s:g}",
        "Restart=always",
        f"RestartSec={pause_s:g}",
        *grows,
        "KillMode=mixed",
        f"TimeoutStopSec={STOP_S}",
        "SuccessExitStatus=130 143",
        "NoNewPrivileges=yes",
        "",
        "[Install]",
        f"WantedBy={target_name(setup.name)}",
    ]
    return "\n".join(lines) + "\n"


def target(setup: Setup) -> str:
    """The unit that starts and stops all of them."""
    wants = " ".join(unit_name(setup.name, process.name) for process in rows(setup))
    lines = ["[Unit]", f"Description=lira: all of '{setup.name}'", f"Wants={wants}", ""]
    return "\n".join([*lines, "[Install]", "WantedBy=default.target"]) + "\n"
