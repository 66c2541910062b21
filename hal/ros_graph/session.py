"""Opens a zenoh session as rmw_zenoh's nodes have it: with a router, by which they find each other.

Their router (`ros2 run rmw_zenoh_cpp rmw_zenohd`) listens at port 7447. Here a session either is a client of one, or,
where there is none, the router itself. It has nothing to do with the bus of a robot of ours: no links, keys or limits
of that.
"""

import json

import zenoh

from lira.hal.bus.topics import MESSAGE_BYTES
from lira.hal.bus.zenoh_session import SETTINGS
from lira.hal.errors import BusError


def open_ros_session(*, connect: str | None = None, listen: str | None = None) -> zenoh.Session:
    """Open one: a client of the router at `connect`, the router at `listen`, or connected to nobody. Raises `BusError`.

    A router passes on whatever size others send to one another.
    """
    config = zenoh.Config()
    for key, value in {
        **SETTINGS,
        "mode": "router" if listen else "client" if connect else "peer",
        "transport/unicast/max_links": 1,
        "transport/link/rx/max_message_size": 2**30 if listen else MESSAGE_BYTES,
        # Nodes are peers: the router tells each of the others, and they connect to one another.
        "scouting/gossip/enabled": bool(listen),
        "listen/endpoints": [f"tcp/{listen}"] if listen else [],
        "connect/endpoints": [f"tcp/{connect}#exit_on_failure=true"] if connect else [],
    }.items():
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        reason = str(error).split(" at /")[0].split(": [")[-1]
        if listen and "in use" in reason:
            remedy = "A router is there already: name it with --ros2 HOST:PORT; or choose another port."
            raise BusError(f"{listen} is already in use", remedy) from error
        raise BusError(f"cannot open a ROS 2 graph at {connect or listen}: {reason}", "Check the address.") from error
