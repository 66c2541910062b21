"""What a HAL server says about itself once a second, on `diagnostics`: the governor, what was refused, the links."""

import sys
import threading
import time
from dataclasses import replace

from lira.hal.bus.access_log import FULL, LINK
from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import DIAGNOSTICS
from lira.hal.messages import DiagnosticArray, DiagnosticStatus
from lira.hal.safety.arming import State
from lira.hal.safety.governed import GovernedRobot

OK, WARN = 0, 1
PATIENCE_S = 3.0  # a peer that has just come has one link for a moment
NO_DATAGRAMS = "UDP does not get through: over TCP alone commands queue up in a gap of the radio (check the firewall)"
CROWD = "no more files may be opened, so nobody can connect: does somebody hold connections open? (see ulimit -n)"
STRANGER = "somebody without a valid certificate tries to connect (counted on diagnostics; see lira keys show)"


class LinkWatch:
    """Says when peers stay with one link. Pure; the time comes in."""

    def __init__(self) -> None:
        self._short_since_s: float | None = None

    def look(self, short_peers: int, now_s: float) -> str:
        """Return what is wrong with the links, "" if nothing is or not for long enough."""
        if short_peers == 0:
            self._short_since_s = None
        elif self._short_since_s is None:
            self._short_since_s = now_s
        short = self._short_since_s is not None and now_s - self._short_since_s >= PATIENCE_S
        return NO_DATAGRAMS if short else ""


class Reporter:
    """Publishes the diagnostics, and prints what is new and wrong to standard error."""

    def __init__(self, robot: GovernedRobot, bus: Bus) -> None:
        self._robot = robot
        self._bus = bus
        self._watch = LinkWatch()
        self._publisher = bus.publisher(DIAGNOSTICS)
        self._said = ""
        self._strangers = False
        self._full = 0

    def run(self, stop: threading.Event) -> None:
        """Report until `stop` is set."""
        if self._robot.field_off:
            print(f"{self._bus.robot}: {self._robot.field_off}", file=sys.stderr, flush=True)
        while not stop.wait(1.0 / DIAGNOSTICS.rate_hz):
            trouble = self._trouble(time.monotonic())
            if trouble and trouble != self._said:
                print(f"{self._bus.robot}: {trouble}", file=sys.stderr, flush=True)
            self._said = trouble
            self._tell_of_strangers()
            now_s = self._robot.now()
            told = (self._governor(), self._link(trouble), *self._devices())
            self._publisher.put(DiagnosticArray(now_s, told), now_s)

    def _devices(self) -> list[DiagnosticStatus]:
        """What the robot's devices say, under its name."""
        return [replace(status, name=f"{self._bus.robot}: {status.name}") for status in self._robot.diagnostics]

    def _trouble(self, now_s: float) -> str:
        """What is wrong with the links: the worst of it, "" for nothing."""
        full, self._full = self._full, self._bus.refusals.counts[FULL]
        slow = self._watch.look(self._bus.short_peers(), now_s)
        return self._bus.trouble or (CROWD if self._full > full else "") or slow

    def _tell_of_strangers(self) -> None:
        """Say so when the first link is refused: it may well be the owner's, with keys that have expired."""
        strangers = self._bus.refusals.counts[LINK] > 0
        if strangers and not self._strangers:
            print(f"{self._bus.robot}: {STRANGER}", file=sys.stderr, flush=True)
        self._strangers = strangers

    def _governor(self) -> DiagnosticStatus:
        state = self._robot.state
        at_the_door = {f"{key}: {reason}": count for (key, reason), count in self._bus.boundary.counts.items()}
        counts = self._robot.refused | at_the_door
        values = tuple((f"refused: {reason}", str(count)) for reason, count in sorted(counts.items()))
        values += (("device losses", str(self._robot.losses)),)
        if self._robot.field_off:
            values += (("protective field", self._robot.field_off),)
        well = state in (State.DISARMED, State.ARMED) and not self._robot.field_off
        return DiagnosticStatus(OK if well else WARN, f"{self._bus.robot}: governor", state.value, values)

    def _link(self, trouble: str) -> DiagnosticStatus:
        values = (
            ("links", str(self._bus.links())),
            ("peers", str(self._bus.peers())),
            ("encrypted", str(self._bus.encrypted).lower()),
            *((f"refused {kind}", str(count)) for kind, count in self._bus.refusals.counts.items()),
        )
        return DiagnosticStatus(
            WARN if trouble else OK, f"{self._bus.robot}: link", trouble or "two links each", values
        )
