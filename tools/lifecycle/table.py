"""The one list of processes. It is the architecture: what runs where, in which order, and what it takes.

`lira up` starts those of a set on this machine, and `lira deploy` makes a systemd unit of each. Whatever drives begins
paused, the first time as any other: nothing here ever sets a robot off, a person does.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from lira.hal.errors import ConfigError
from lira.tools.launch.processes import lira_command
from lira.tools.lifecycle.setup import Setup


class Host(StrEnum):
    """Which machine a process runs on."""

    ROBOT = "robot"
    LAPTOP = "laptop"


@dataclass(frozen=True, slots=True)
class Process:
    """One row. `words` makes the arguments of `lira` from a set-up, or of Python where they begin with `-m`.

    `packages` have to be installed, by their import names. `is_robot`: the others wait for it. It is hung if it gives
    no sign of life for `patience_s`.
    """

    name: str
    does: str
    words: Callable[[Setup], Sequence[str]]
    host: Host = Host.LAPTOP
    packages: tuple[str, ...] = ()
    is_robot: bool = False
    patience_s: float = 30.0

    def command(self, setup: Setup, python: str = sys.executable) -> list[str]:
        """The command line, in the interpreter `python`."""
        words = list(self.words(setup))
        return [python, *words] if words[0] == "-m" else lira_command(*words, python=python)


def _reach(setup: Setup) -> list[str]:
    return ["--name", setup.name, "--connect", setup.endpoint]


def _serve(setup: Setup) -> list[str]:
    return ["--name", setup.name, "--listen", setup.endpoint]


def _learner(setup: Setup) -> list[str]:
    words = ["fusion", *_reach(setup), "--method", setup.method, "--paused", "--run", setup.folder]
    return [*words, "--layout", str(setup.layout), "--no-record"]  # that is a process of its own here


def _driver(setup: Setup) -> list[str]:
    return ["drive", setup.policy, *_reach(setup), "--paused", "--layout", str(setup.layout)]


def _page(setup: Setup) -> list[str]:
    return ["web", *_reach(setup), "--port", str(setup.page_port), "--layout", str(setup.layout)]


PROCESSES: tuple[Process, ...] = (
    Process(
        "robot",
        "the physical robot: its devices, the governor, the bus",
        lambda setup: ["robot", *setup.robot, *_serve(setup)],
        host=Host.ROBOT,
        packages=("serial",),
        is_robot=True,
        patience_s=10.0,
    ),
    Process(
        "twin",
        "the simulated robot in its place",
        lambda setup: ["twin", *setup.twin, *_serve(setup), "--layout", str(setup.layout)],
        is_robot=True,
        patience_s=10.0,
    ),
    Process(
        "monitor",
        "hears rates, ages and who drives, for `lira status`",
        lambda setup: ["-m", "lira.tools.lifecycle.watch.monitor", setup.name, setup.endpoint],
    ),
    Process(
        "recorder",
        "records all that is on the bus",
        lambda setup: ["record", *_reach(setup), "--run", setup.folder],
        packages=("mcap",),
    ),
    Process("learner", "decides, drives and learns", _learner, packages=("safetensors",)),
    Process("driver", "lets one policy drive", _driver, packages=("safetensors",)),
    Process("page", "shows the robot in a browser, and drives it from there", _page, packages=("aiohttp", "segno")),
    Process("pad", "a gamepad on this machine, straight to the robot", lambda setup: ["joystick", *_reach(setup)]),
)

SETS: dict[str, tuple[str, ...]] = {
    "teach": ("twin", "monitor", "recorder", "learner", "page", "pad"),
    "drive": ("twin", "monitor", "recorder", "driver", "page", "pad"),
    "look": ("twin", "monitor", "page", "pad"),
}


def chosen(set_name: str, *, twin: bool, without: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the rows of a set, less those without which it shall be. Raises `ConfigError` for a name of none."""
    names = [name for name in SETS[set_name] if twin or name != "twin"]
    for name in without:
        if name not in names:
            raise ConfigError(f"the set '{set_name}' has no process '{name}'", f"It has: {', '.join(names)}.")
    return tuple(name for name in names if name not in without)


def rows(setup: Setup) -> list[Process]:
    """The rows of a set-up, in the order in which they start."""
    return [process for process in PROCESSES if process.name in setup.processes]
