"""What `lira up` was asked for: which robot, which set of processes, and the words that they get."""

from pathlib import Path

import msgspec

from lira.hal.bus.endpoint import DEFAULT_ENDPOINT, DEFAULT_ROBOT

PORT = 7447
PAGE_PORT = 8080


class Setup(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One robot's set-up. `endpoint` (HOST:PORT) is where the robot listens.

    `twin` are the words for `lira twin`, and `world` is its world, "" for a robot that is somewhere else: its own
    machine runs it, with the words `robot` for `lira robot`. `processes` are the rows of the table that were chosen, by
    name. `folder` is the run's: what is learned and recorded.
    """

    name: str = DEFAULT_ROBOT
    endpoint: str = DEFAULT_ENDPOINT
    processes: tuple[str, ...]
    world: str = ""
    twin: tuple[str, ...] = ()
    robot: tuple[str, ...] = ()
    layout: int = 0
    method: str = "plus"
    policy: str = ""
    folder: str = ""
    page_port: int = PAGE_PORT

    @property
    def where(self) -> str:
        """The robot in a few words."""
        return f"twin in '{self.world}' at {self.endpoint}" if self.world else f"robot at {self.endpoint}"


def command_line(verb: str, name: str) -> str:
    """The command line of a verb for the robot of a name."""
    return f"lira {verb}" if name == DEFAULT_ROBOT else f"lira {verb} --name {name}"


def endpoint_of(host: str) -> str:
    """Return HOST:PORT of a robot's HOST, HOST:PORT or [ADDRESS]; a port that is not said is the usual one."""
    last = host.rpartition(":")[2]
    has_port = last.isdecimal() and (host.count(":") == 1 or host.startswith("["))
    if has_port:
        return host
    return f"[{host}]:{PORT}" if ":" in host and not host.startswith("[") else f"{host}:{PORT}"


def run_folder(setup_name: str, what: str, world: str) -> Path:
    """Where what is learned and recorded goes, unless somebody says where; a learner goes on there the next time."""
    return Path("runs") / f"{what.replace(':', '-')}-{Path(world).stem or setup_name}"
