"""The processes that make up a robot on the bus: the twin itself, or `lira robot` on the devices of a twin."""

import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from lira.tools.launch.processes import ChildProcess, lira_command

READY_S = 60.0
OPEN_WITH = "open them with: lira robot "


@dataclass(frozen=True, slots=True)
class Part:
    """A process that has to be ready before the next is started: then it writes a line with `ready` in it.

    `command` gets the line with which the part before it said that it was ready, "" for the first.
    """

    name: str
    log: str
    ready: str
    command: Callable[[str], list[str]]


def twin_words(
    world: str, profile: str | None, seed: int, renderer: str | None = None, *, randomise: bool = False
) -> list[str]:
    """Which twin it is, in words for `lira twin`: the robot of the world's experiment, and the quickest renderer.

    Raises `ConfigError` for a world or a profile that is none.
    """
    from lira.fusion.experts.tasks import TASKS, task_of
    from lira.hal.profile import load_profile
    from lira.sim_backend.catalogue import load_world
    from lira.sim_backend.scenes.opening import quickest

    place = load_world(world)
    robot = profile or TASKS[task_of(place.name)].profile
    load_profile(robot)
    words = ["--world", world, "--profile", robot, "--renderer", renderer or quickest(place), "--seed", str(seed)]
    return [*words, "--randomise"] if randomise else words


def direct(name: str, endpoint: str, twin: Sequence[str], *, lockstep: bool) -> list[Part]:
    """The twin as a robot on the bus. `twin` are the words that say which: world, profile, layout, seed."""
    words = ["twin", *twin, "--name", name, "--listen", endpoint, *(["--lockstep"] if lockstep else [])]
    return [Part("the twin", "twin.log", "serves world", lambda _: lira_command(*words))]


def wired(
    name: str, endpoint: str, arena: str, folder: Path, twin: Sequence[str], robot: Sequence[str] = ()
) -> list[Part]:
    """`lira robot` on the devices of a twin, which makes them in `folder` and tells the truth at `arena`.

    `robot` are more words for `lira robot`.
    """
    words = ["twin", *twin, "--name", name, "--wire", str(folder), "--arena", arena]

    def open_devices(line: str) -> list[str]:
        devices = shlex.split(line.partition(OPEN_WITH)[2])
        return lira_command("robot", *devices, *robot, "--name", name, "--listen", endpoint)

    return [
        Part("the twin", "twin.log", OPEN_WITH, lambda _: lira_command(*words)),
        Part("the robot", "lira.robot.log", "serves", open_devices),
    ]


@contextmanager
def running(
    parts: Sequence[Part], folder: Path, say: Callable[[str], None] = lambda _: None
) -> Iterator[list[ChildProcess]]:
    """Start the parts in turn, with their logs in `folder`; stop them in the opposite order at the end.

    `say` gets the line with which each says that it is ready. Raises `ProcessError` for one that does not.
    """
    children: list[ChildProcess] = []
    with ExitStack() as stack:
        line = ""
        for part in parts:
            child = stack.enter_context(ChildProcess(part.name, part.command(line), folder / part.log))
            line = child.wait_ready(part.ready, READY_S)
            say(line)
            children.append(child)
        yield children
