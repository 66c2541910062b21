"""Opens a zenoh session as a robot or its peer needs it.

zenoh sends what must arrive over the datagram link, too, while that is the only one: what two ends declare to each
other when they meet would be lost with a datagram, for good. So the stream comes first. A session that connects opens
when its stream is up, or not at all; the datagrams follow in the background, as soon as they get through.
"""

import json
import resource

import zenoh

from lira.hal.bus.security.access import access_list
from lira.hal.bus.security.keys import Keys
from lira.hal.bus.topics import ATTACHMENT_BYTES, COMMANDS, MESSAGE_BYTES, QUESTION_BYTES, TOPICS, named
from lira.hal.errors import BusError, ConfigError

LEASE_MS = 2000
OPEN_MS = 2000
CONNECT_MS = 3000
FILES = 65536
# Of every session.
SETTINGS = {
    "connect/timeout_ms": CONNECT_MS,
    "connect/exit_on_failure": False,
    "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2},
    # Do not wait for the datagrams: whoever opens watches links from the first on.
    "scouting/delay": 0,
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/unicast/max_links": 2,
    # Whoever has no keys for a robot that wants some hears it after this long.
    "transport/unicast/open_timeout": OPEN_MS,
    # Whoever begins to connect and says no more holds up a close for this long.
    "transport/unicast/accept_timeout": OPEN_MS,
    "transport/link/tx/lease": LEASE_MS,
    "transport/link/rx/max_message_size": MESSAGE_BYTES,
    # It can lose a message when a receiver stalls.
    "transport/shared_memory/enabled": False,
    # Late readers of a latched topic are served by its time stamp.
    "timestamping/enabled": True,
}


def open_session(
    robot: str,
    listen: str | None,
    connect: str | None,
    keys: Keys | None,
    *,
    prefix: str | None = None,
    watch: bool = False,
) -> zenoh.Session:
    """Open one; the arguments are those of `hal.bus.Bus`. With neither address it is connected to nobody.

    What is longer than its topic allows ends here: neither is it put together nor does it wait in a queue. Whoever
    listens is a robot, and lets others do what `hal/bus/security/access.py` says. Whoever connects hears the robot
    alone.

    Raises `BusError`: if it does not connect, after `CONNECT_MS` at the latest; `ConfigError`: to listen with keys that
    are no robot's.
    """
    if listen is not None and keys is not None and keys.roles is None:
        raise ConfigError(
            f"{keys.folder} holds the keys of {keys.name}, which is no robot", "Use the bundle made for the robot."
        )
    if listen is not None:
        _make_room()
    config = zenoh.Config()
    for key, value in {
        **SETTINGS,
        # Both ends are peers: a client would use one link only. What peers say is passed on to clients alone.
        "mode": "client" if watch else "peer",
        "listen/endpoints": [] if listen is None else _links(listen, keys),
        "connect/endpoints": [] if connect is None else _connecting(_links(connect, keys), watch=watch),
        "low_pass_filter": _size_limits(robot if prefix is None else prefix),
        **({} if keys is None else {"transport/link/tls": keys.link_config()}),
        **({} if listen is None else {"access_control": access_list(robot, None if keys is None else keys.roles)}),
    }.items():
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise _told(error, listen, connect) from error


def _told(error: zenoh.ZError, listen: str | None, connect: str | None) -> BusError:
    """What to say when none opens. zenoh nests its reasons in brackets, each with the place in its code."""
    reason = str(error).split(" at /")[0].split(": [")[-1]
    if "in use" in reason:
        remedy = "Stop the other program (another robot?), or choose another port with --listen HOST:PORT."
        return BusError(f"{listen} is already in use", remedy)
    return BusError(
        f"cannot open the bus at {listen or connect}: {reason}", "Check the address, and that the robot runs."
    )


def _make_room() -> None:
    """Let this process open as many files as it may: whoever comes, with keys or without, holds one for a while."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = FILES if hard == resource.RLIM_INFINITY else min(FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def _size_limits(prefix: str) -> list[dict[str, object]]:
    """How long a message that comes may be, by key."""
    topics = (*TOPICS, *(named(topic, "*") for topic in COMMANDS))
    limits = {topic.key: topic.max_bytes + ATTACHMENT_BYTES for topic in topics}
    rules = [(["put"], f"{prefix}/{key}".lstrip("/"), limit) for key, limit in limits.items()]
    rules.append((["query"], "**", QUESTION_BYTES + ATTACHMENT_BYTES))
    return [
        {"id": f"{number}", "flows": ["ingress"], "messages": messages, "key_exprs": [key], "size_limit": limit}
        for number, (messages, key, limit) in enumerate(rules)
    ]


def _links(endpoint: str, keys: Keys | None) -> tuple[str, str]:
    """One TCP link for what must arrive and one UDP link for what must be new (zenoh picks by reliability).

    With keys these are TLS, and the datagrams of QUIC.
    """
    stream, datagram = ("tcp", "udp") if keys is None else ("tls", "quic")
    return f"{stream}/{endpoint}?rel=1", f"{datagram}/{endpoint}?rel=0"


def _connecting(links: tuple[str, str], *, watch: bool) -> list[str]:
    stream, datagram = links
    return [stream] if watch else [f"{stream}#exit_on_failure=true", datagram]
