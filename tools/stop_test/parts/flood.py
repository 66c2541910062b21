"""A peer that sends as much as fits through, until it is killed. It speaks plain zenoh, which is fastest.

python -m lira.tools.stop_test.parts.flood HOST:PORT ROBOT KIND
"""

import json
import struct
import sys
import time

import zenoh

from lira.hal.bus.topics import ESTOP_LOOK, INFO

BACK = b"\x00\x01\x00\x00" + struct.pack("<6d", -0.1, 0.0, 0.0, 0.0, 0.0, 0.0)  # geometry_msgs/Twist in CDR
SIZES = {"commands": len(BACK), "samples of 1 MB": 1_000_000}
QUERIES = "queries"
ASKED = (INFO, ESTOP_LOOK)
AT_ONCE, PAUSE_S = 64, 0.001  # queries under way: more than the robot can hold


def main(endpoint: str, robot: str, kind: str) -> None:
    """Connect, say so, and flood."""
    config = zenoh.Config()
    links = [f"tcp/{endpoint}?rel=1", f"udp/{endpoint}?rel=0"]
    for key, value in {"connect/endpoints": links, "scouting/multicast/enabled": False}.items():
        config.insert_json5(key, json.dumps(value))
    session = zenoh.open(config)
    print("floods", flush=True)
    if kind == QUERIES:
        ask(session, robot)
    payload = BACK.ljust(SIZES[kind], b"\0")
    publisher = session.declare_publisher(f"{robot}/cmd_vel", congestion_control=zenoh.CongestionControl.BLOCK)
    while True:
        publisher.put(payload)


def ask(session: zenoh.Session, robot: str) -> None:
    """Ask for ever, without waiting for the answers."""
    while True:
        answers = [session.get(f"{robot}/{key}", timeout=1.0) for key in ASKED for _ in range(AT_ONCE)]
        time.sleep(PAUSE_S)
        del answers


if __name__ == "__main__":
    main(*sys.argv[1:])
