"""Robots that are measured: each a process of its own, on a free port of this machine."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from lira.tools.bench.parts import null_robot
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

READY_S = 60.0


class Site(NamedTuple):
    """A robot's name, where it listens, and a folder for what is left behind."""

    name: str
    endpoint: str
    folder: Path


@contextmanager
def null_robot_at_work(*words: str) -> Iterator[Site]:
    """Start a robot that is not there, and end it with the block."""
    port = free_port()
    name, endpoint = f"bench_{port}", f"127.0.0.1:{port}"
    command = [sys.executable, "-m", null_robot.__name__, name, endpoint, *words]
    with _started("robot", command, null_robot.READY) as folder:
        yield Site(name, endpoint, folder)


@contextmanager
def twin_at_work(*words: str) -> Iterator[Site]:
    """Start a twin, and end it with the block."""
    port = free_port()
    name, endpoint = f"bench_{port}", f"127.0.0.1:{port}"
    command = lira_command("twin", "--name", name, "--listen", endpoint, *words)
    with _started("twin", command, "serves world") as folder:
        yield Site(name, endpoint, folder)


@contextmanager
def _started(what: str, command: Sequence[str], ready: str) -> Iterator[Path]:
    with TemporaryDirectory() as name, ChildProcess(f"the {what}", command, Path(name) / f"lira.{what}.log") as child:
        child.wait_ready(ready, READY_S)
        yield Path(name)
