"""Somebody else on the bus, who means no good."""

import time
from collections.abc import Callable

from hal.attachment import Attachment
from hal.bus import Bus
from hal.codec import encode
from hal.messages import STOP, Applied, Twist
from hal.topics import APPLIED, CMD_VEL

TIMES = 15
PAUSE_S = 0.02
BACK = Twist(-0.1, 0.0)
WAIT_S = 5.0
OLD_S = 1.0


class Intruder:
    """Puts commands of every kind on `cmd_vel`, with what it hears from the robot."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
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
        old = Attachment(heard.epoch, max(heard.seq - 1, 0), round((heard.stamp_s - OLD_S) * 1e9)).to_bytes()
        self._repeat(lambda: self._bus.put_raw(CMD_VEL, encode(BACK), old))

    def take_lease(self) -> None:
        """Become the commander, and stand."""
        self._repeat(lambda: self._publisher.put(STOP, self._hear().stamp_s))

    def leave(self) -> None:
        """Let go of the lease."""
        self._publisher.put(STOP, self._hear().stamp_s, released=True)

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
