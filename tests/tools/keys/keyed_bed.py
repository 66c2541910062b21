"""A robot with keys, and those who come to it with good, bad or no keys and sessions that keep to no rules of ours."""

import json
import threading
import time
from contextlib import contextmanager

import zenoh

from lira.hal.bus.bus import Bus
from lira.hal.bus.security.keys import Role, load_keys
from lira.hal.messages import Command, Twist
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.testing import NullRobot
from lira.tools.authority import enroll, init
from lira.tools.launch.processes import free_port

GO = Twist(0.5, 0.0)
NAME = "keyed"


def make_keys(folder):
    """Of a robot, its laptop, anna who drives and a guest who looks."""
    init(folder)
    enroll(folder, "anna")
    enroll(folder, "guest", Role.VIEWER)
    return folder


@contextmanager
def serving(folder):
    """A robot with keys: where it listens, and itself."""
    endpoint, stop, ready = f"127.0.0.1:{free_port()}", threading.Event(), threading.Event()
    inner = NullRobot(load_profile("thesis-sim"), time.monotonic, time.sleep)
    bus = Bus(NAME, listen=endpoint, keys=load_keys(folder / "robot"))
    server = threading.Thread(target=HalServer(GovernedRobot(inner), bus, ready=ready.set).run, args=[stop])
    server.start()
    try:
        assert ready.wait(10.0)
        yield endpoint, inner
    finally:
        stop.set()
        server.join(10.0)
        assert bus.close()


def drive_until(client, twist, wanted):
    deadline_s = time.monotonic() + 5.0
    while not wanted(client.drive(Command(twist, client.now()))):
        assert time.monotonic() < deadline_s


def wait_for(condition, timeout_s):
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, "never happened"
        time.sleep(0.02)


def plain_session(endpoint, **more):
    config = zenoh.Config()
    for key, value in {
        "mode": '"peer"',
        "scouting/gossip/enabled": "false",
        "connect/endpoints": f'["tcp/{endpoint}", "udp/{endpoint}"]',
        "connect/timeout_ms": "0",
        "connect/exit_on_failure": "false",
        "scouting/multicast/enabled": "false",
        "transport/unicast/open_timeout": "300",
        **more,
    }.items():
        config.insert_json5(key, value)
    return zenoh.open(config)


def tls(folder):
    """What a session of nobody's making needs to use a bundle."""
    return {"transport/link/tls": json.dumps(load_keys(folder).link_config())}


@contextmanager
def attacker(folder, endpoint, who, mode):
    """Somebody who is enrolled, with a session that keeps to none of our rules."""
    links = {"connect/endpoints": json.dumps([f"tls/{endpoint}?rel=1"]), "connect/timeout_ms": "2000"}
    more = {"mode": json.dumps(mode), "timestamping/enabled": "true", "transport/unicast/open_timeout": "2000"}
    session = plain_session(endpoint, **{**tls(folder / who), **links, **more})
    try:
        wait_for(lambda: len(session.info.peers_zid()) == 1, 5.0)
        yield session
    finally:
        session.close()


def replies(session, key, payload=b""):
    return [bytes(reply.ok.payload) for reply in session.get(f"{NAME}/{key}", payload=payload, timeout=1.0) if reply.ok]
