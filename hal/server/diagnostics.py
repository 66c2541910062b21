"""What a HAL server says about itself once a second, on `diagnostics`: the governor, what was refused, the links."""

import sys
import threading
import time
from dataclasses import replace

from lira.hal.bus.boundary import UNDECODABLE
from lira.hal.bus.bus import Bus
from lira.hal.bus.security.access_log import FULL, LINK
from lira.hal.bus.topics import COMMANDS, DIAGNOSTICS
from lira.hal.messages import DiagnosticArray, DiagnosticStatus
from lira.hal.safety.arming import State
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.command_watch import CommandWatch

OK, WARN = 0, 1
WAITING = (State.DISARMED, State.STOPPED)  # for a neutral command
PATIENCE_S = 3.0  # a peer that has just come has one link for a moment
NO_DATAGRAMS = "UDP does not get through: over TCP alone commands queue up in a gap of the radio (check the firewall)"
CLIENT = "who hear the robot alone: a bridge or viewer that connects as a client hears all"
CROWD = "no more files may be opened, so nobody can connect: does somebody hold connections open? (see ulimit -n)"
NO_TWIST = "what comes on '{key}' is neither geometry_msgs/Twist nor TwistStamped"
CLOCK_OFF_S = 0.5
CLOCK_OFF = "times on the bus are not those of this computer: its time of day was set since the robot started"
STRANGER = "somebody without a valid certificate tries to connect (counted on diagnostics; see lira keys show)"


class LinkWatch:
    """Says when peers that command stay with one link. Pure; the time comes in."""

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
    """Publishes the diagnostics, and prints what is new and wrong to standard error.

    `commands` knows who commands: a viewer with one link is no trouble, and what a ROS peer does wrong is told.
    """

    def __init__(self, robot: GovernedRobot, bus: Bus, commands: CommandWatch) -> None:
        self._robot = robot
        self._bus = bus
        self._commands = commands
        self._watch = LinkWatch()
        self._publisher = bus.publisher(DIAGNOSTICS)
        self._said = ""
        self._advised: tuple[str, ...] = ()
        self._undecodable: dict[str, int] = {}
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
            self._advise(time.monotonic())
            now_s = self._robot.now()
            told = (self._governor(), self._link(trouble), self._clock(now_s), *self._devices())
            self._publisher.put(DiagnosticArray(now_s, told), now_s)

    def _devices(self) -> list[DiagnosticStatus]:
        """What the robot's devices say, under its name."""
        return [replace(status, name=f"{self._bus.robot}: {status.name}") for status in self._robot.diagnostics]

    def _trouble(self, now_s: float) -> str:
        """What is wrong with the links: the worst of it, "" for nothing."""
        full, self._full = self._full, self._bus.refusals.counts[FULL]
        short = self._bus.short_sessions() & self._commands.commanders(now_s)
        slow = self._watch.look(len(short), now_s)
        return self._bus.trouble or (CROWD if self._full > full else "") or slow

    def _tell_of_strangers(self) -> None:
        """Say so when the first link is refused: it may well be the owner's, with keys that have expired."""
        strangers = self._bus.refusals.counts[LINK] > 0
        if strangers and not self._strangers:
            print(f"{self._bus.robot}: {STRANGER}", file=sys.stderr, flush=True)
        self._strangers = strangers

    def _advise(self, now_s: float) -> None:
        """Tell those whose commands do not drive why not: all of it on diagnostics, what is new on standard error."""
        before = self._advised
        advice = self._commands.advice(now_s, armed=self._robot.state not in WAITING)
        self._advised = (*advice, *self._unknown_types())
        for each in self._advised:
            if each not in before:
                print(f"{self._bus.robot}: {each}", file=sys.stderr, flush=True)

    def _unknown_types(self) -> list[str]:
        """Say on which topic of commands something else came since the last time."""
        found = []
        for key in (topic.key for topic in COMMANDS):
            count = self._bus.boundary.counts.get((key, UNDECODABLE), 0)
            if count > self._undecodable.get(key, 0):
                found.append(NO_TWIST.format(key=key))
            self._undecodable[key] = count
        return found

    def _governor(self) -> DiagnosticStatus:
        state = self._robot.state
        at_the_door = {f"{key}: {reason}": count for (key, reason), count in self._bus.boundary.counts.items()}
        counts = self._robot.refused | at_the_door
        values = tuple((f"refused: {reason}", str(count)) for reason, count in sorted(counts.items()))
        values += (("device losses", str(self._robot.losses)),)
        values += tuple(("advice", each) for each in self._advised)
        if self._robot.field_off:
            values += (("protective field", self._robot.field_off),)
        well = state in (State.DISARMED, State.ARMED) and not self._robot.field_off
        return DiagnosticStatus(OK if well else WARN, f"{self._bus.robot}: governor", state.value, values)

    def _clock(self, now_s: float) -> DiagnosticStatus:
        """How the times on the bus go with this computer's time of day, which may have been set since."""
        off_s = now_s + self._bus.offset_s - time.time()
        values = (
            ("ahead of its own clock s", f"{self._bus.offset_s:.6f}"),
            ("ahead of time s", f"{off_s:.6f}"),
        )
        off = abs(off_s) > CLOCK_OFF_S
        return DiagnosticStatus(
            WARN if off else OK, f"{self._bus.robot}: clock", CLOCK_OFF if off else "counts from 1970", values
        )

    def _link(self, trouble: str) -> DiagnosticStatus:
        short = self._bus.short_peers()
        values = (
            ("links", str(self._bus.links())),
            ("peers", str(self._bus.peers())),
            *((("peers with one link", f"{short}, {CLIENT}"),) if short else ()),
            ("encrypted", str(self._bus.encrypted).lower()),
            *((f"refused {kind}", str(count)) for kind, count in self._bus.refusals.counts.items()),
        )
        return DiagnosticStatus(
            WARN if trouble else OK, f"{self._bus.robot}: link", trouble or "two links each", values
        )
