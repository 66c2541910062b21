"""Which ROS 2 graph a robot of ours is offered to: the words for it, and the process that does it. Without zenoh."""

import argparse
import contextlib
import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass

from lira.hal.bus.endpoint import check_address, is_loopback
from lira.hal.errors import ConfigError
from lira.tools.launch.processes import dying_with_parent, lira_command
from lira.tools.options import add_ros_domain

OWN_ROUTER = "127.0.0.1:7448"  # the bus has rmw_zenohd's usual port, 7447
KEYS = "LIRA_KEYS"
END_S = 6.0


@dataclass(frozen=True, slots=True)
class Graph:
    """A graph of rmw_zenoh. `router` is where its router listens, or with `own` where this is the router itself."""

    router: str = OWN_ROUTER
    own: bool = True
    domain: int = 0
    namespace: str = "/"

    def told(self) -> list[str]:
        """What its nodes need to know, for who starts them."""
        place = f"rmw_zenoh, domain {self.domain}, namespace {self.namespace}"
        if not self.own:
            return [f"in the ROS 2 graph ({place}) of the router at {self.router}"]
        override = f'connect/endpoints=["tcp/{self.router}"]'
        return [
            f"in a ROS 2 graph of its own ({place}); before ROS's nodes and tools are started:",
            f"  export RMW_IMPLEMENTATION=rmw_zenoh_cpp ROS_DOMAIN_ID={self.domain} ZENOH_CONFIG_OVERRIDE='{override}'",
        ]


def graph_of(address: str, domain: int, namespace: str, *, insecure: bool = False) -> Graph:
    """Return the graph of the router at an address; for "" one of its own, and for `own:HOST:PORT` there.

    Raises `ConfigError`, also for a router that other machines reach, unless `insecure`: such a graph knows no keys.
    """
    own = not address or address.startswith("own:")
    router = address.removeprefix("own:") or OWN_ROUTER
    check_address(router)
    if not (insecure or is_loopback(router)):
        what = f"anybody in the ROS 2 graph of {router} could drive the robot"
        raise ConfigError(what, "Take a router on this machine, or say --insecure: rmw_zenoh has no keys here.")
    return Graph(router, own, domain, namespace)


def add_graph(parser: argparse.ArgumentParser) -> None:
    """Declare that a robot which is served is offered to ROS, too: `--ros2` and what belongs to it."""
    add = parser.add_argument
    add(
        "--ros2",
        nargs="?",
        const="",
        metavar="HOST:PORT",
        help="offer it to ROS 2 (rmw_zenoh), too: in the graph of the router there; without an address in one of its "
        f"own at {OWN_ROUTER}, or at own:HOST:PORT",
    )
    add_ros_domain(parser, "with --ros2: ROS_DOMAIN_ID", name="--ros2-domain")
    add("--ros2-namespace", default="/", metavar="NAME", help="with --ros2: namespace of its topics (default: none)")
    add("--ros2-keys", metavar="DIR", help="with --ros2, and keys: the bundle in whose name ROS commands (lira keys)")


@contextlib.contextmanager
def offered(args: argparse.Namespace) -> Iterator[None]:
    """Have a process beside this one offer the robot that is served by `args`, if they say so.

    What it says goes where this process's words go. It ends with this process; the robot goes on without it.
    """
    if args.ros2 is None:
        yield
        return
    if os.environ.get(KEYS) and args.ros2_keys is None:
        what = "the robot has keys, and ROS has none to command with"
        raise ConfigError(what, "Make some with: lira keys enroll ros; and name them with --ros2-keys keys/ros.")
    graph_of(args.ros2, args.ros2_domain, args.ros2_namespace, insecure=args.insecure)
    host, _, port = args.listen.rpartition(":")
    address = f"127.0.0.1:{port}" if host in ("0.0.0.0", "[::]") else args.listen
    words = ["ros2", "--offer", args.ros2, "--connect", address, "--name", args.name]
    words += ["--domain", str(args.ros2_domain), "--namespace", args.ros2_namespace]
    words += ["--insecure"] if args.insecure else []
    process = subprocess.Popen(
        dying_with_parent(lira_command(*words)),
        stdin=subprocess.DEVNULL,
        env=os.environ | ({KEYS: args.ros2_keys} if args.ros2_keys else {}),
        start_new_session=True,
    )
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
