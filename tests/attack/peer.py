"""Peers in processes of their own: `peer.py drive NAME ENDPOINT LOG`, `peer.py flood NAME ENDPOINT SIZE KEY...`,
`peer.py ask NAME ENDPOINT SIZE KEY...`.

The driver notes the time of every command just before it sends it. The others begin at SIGUSR1.
"""

import itertools
import os
import signal
import sys
import time
from pathlib import Path

import zenoh
from zenoh.handlers import RingChannel

from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.client.connect import open_remote
from lira.hal.messages import HELD, STOP, Command, Reason, Twist

GO = Twist(0.15, 0.0)
PERIOD_S = 0.03
LIFE_S = 120


def drive(name, endpoint, log):
    """Drive on and on, as far as the robot lets one."""
    with Path(log).open("w", buffering=1) as notes:
        put = Publisher.put

        def noted(self, message, *words, **more):
            if isinstance(message, Twist):
                notes.write(f"{time.monotonic()}\n")
            put(self, message, *words, **more)

        Publisher.put = noted
        robot = open_remote(Bus(name, connect=endpoint), answer_s=20.0)
        print("drives", flush=True)
        reason = Reason.NO_COMMAND
        while True:
            stands = reason in HELD or reason is Reason.NO_COMMAND
            reason = robot.drive(Command(STOP if stands else GO, robot.now())).reason
            time.sleep(PERIOD_S)


def flood(name, endpoint, size, *keys):
    """Put as much as the link takes, which is neither text nor a number that anybody could use."""
    session = _session(name, endpoint)
    publishers = [
        session.declare_publisher(
            f"{name}/{key}", priority=zenoh.Priority.REAL_TIME, reliability=zenoh.Reliability.RELIABLE, express=True
        )
        for key in keys
    ]
    payload = b"\x00\x01\x00\x00" + b"\x7f" * (int(size) - 4)
    for publisher in itertools.cycle(publishers):
        publisher.put(payload)


def ask(name, endpoint, size, *keys):
    """Ask without waiting for any answer."""
    session = _session(name, endpoint)
    for key in itertools.cycle(keys):
        session.get(f"{name}/{key}", RingChannel(1), payload=b"x" * int(size), timeout=2.0)


def _session(name, endpoint):
    os.nice(10)  # an attacker is another machine, and takes no time of the robot's processor
    bus = Bus(name, connect=endpoint)
    time.sleep(0.5)  # until it is up, on both links
    print("waits", flush=True)
    signal.sigwait({signal.SIGUSR1})
    return bus._session


if __name__ == "__main__":
    signal.alarm(LIFE_S)  # whatever becomes of the test
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})  # before there are threads, which inherit it
    {"drive": drive, "flood": flood, "ask": ask}[sys.argv[1]](*sys.argv[2:])
