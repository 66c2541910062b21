"""Somebody else on the bus, who means no good; with keys, also somebody who has none, or not the right ones."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

import zenoh

from hal.attachment import Attachment
from hal.bus import Bus
from hal.codec import encode
from hal.keys import load_keys
from hal.messages import STOP, Applied, Twist
from hal.topics import APPLIED, CMD_VEL

TIMES = 15
PAUSE_S = 0.02
BACK = Twist(-0.1, 0.0)
WAIT_S = 5.0
OLD_S = 1.0
PLAIN = {
    "mode": '"peer"',
    "connect/timeout_ms": "0",
    "connect/exit_on_failure": "false",
    "scouting/multicast/enabled": "false",
    "transport/unicast/open_timeout": "300",
}


class Intruder:
    """Puts commands of every kind on `cmd_vel`, with what it hears from the robot."""

    def __init__(self, bus: Bus, keys: Path | None = None) -> None:
        self._bus = bus
        self._keys = keys
        self._publisher = bus.publisher(CMD_VEL)
        self._applied = bus.reader(APPLIED)

    def put_raw(self, payload: bytes) -> None:
        """Put what is no command."""
        self._repeat(lambda: self._bus.put_raw(CMD_VEL, payload))

    def rival(self) -> None:
        """Command to back off, with fresh stamps."""
        self._repeat(lambda: self._publisher.put(BACK, self._hear().stamp_s))

    def replay(self) -> None:
        """Say again in the commander's name what it might have said a while ago."""
        heard = self._hear()
        old = Attachment(heard.session, max(heard.seq - 1, 0), round((heard.stamp_s - OLD_S) * 1e9)).to_bytes()
        self._repeat(lambda: self._bus.put_raw(CMD_VEL, encode(BACK), old))

    def take_lease(self) -> None:
        """Become the commander, and stand."""
        self._repeat(lambda: self._publisher.put(STOP, self._hear().stamp_s))

    def leave(self) -> None:
        """Let go of the lease."""
        self._publisher.put(STOP, self._hear().stamp_s, released=True)

    def put_plainly(self) -> None:
        """Put with nothing but zenoh, as a script does that knows the key and has no certificate."""
        config = zenoh.Config()
        for key, value in PLAIN.items():
            config.insert_json5(key, value)
        config.insert_json5("connect/endpoints", f'["tcp/{self._bus.endpoint}", "udp/{self._bus.endpoint}"]')
        session = zenoh.open(config)
        self._repeat(lambda: session.put(f"{self._bus.robot}/{CMD_VEL.key}", encode(BACK)))
        threading.Thread(target=session.close, daemon=True).start()  # it takes its time while it tries to connect

    def put_as(self, who: str) -> None:
        """Put with the certificate of another peer."""
        assert self._keys is not None
        bus = Bus(self._bus.robot, connect=self._bus.endpoint, keys=load_keys(self._keys / who))
        publisher, deadline_s = bus.publisher(CMD_VEL), time.monotonic() + WAIT_S
        while not publisher.matching and time.monotonic() < deadline_s:
            time.sleep(PAUSE_S)
        self._repeat(lambda: publisher.put(BACK, self._hear().stamp_s))
        bus.close()

    def _repeat(self, act: Callable[[], None]) -> None:
        for _ in range(TIMES):
            act()
            time.sleep(PAUSE_S)

    def _hear(self) -> Applied:
        deadline_s = time.monotonic() + WAIT_S
        while (newest := self._applied.newest()) is None:
            if time.monotonic() > deadline_s:
                raise TimeoutError("the robot says nothing about its wheels")
            time.sleep(PAUSE_S)
        return newest.message
