"""Somebody else on the bus, who means no good; with keys, also somebody who has none, or not the right ones."""

import contextlib
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import zenoh

from lira.hal.bus.attachment import MAGIC, Attachment
from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.security.keys import load_keys
from lira.hal.bus.services import look_at_estop, release_estop
from lira.hal.bus.topics import APPLIED, CMD_VEL, TELEOP, Topic, named
from lira.hal.errors import BusError
from lira.hal.messages import STOP, Applied, Twist
from lira.hal.messages.ros.codec import encode
from lira.tools.stop_test.parts import flood
from lira.tools.stop_test.parts.sender import Pen

if TYPE_CHECKING:
    from lira.tools.stop_test.keyring import Keyring

TIMES = 15
PAUSE_S = 0.02
IDLE_S = 0.05
BACK = Twist(-0.1, 0.0)
WAIT_S, RELEASE_S = 5.0, 0.5
AHEAD = 40  # messages: numbers that the commander will come to within a few seconds
CDR_HEADER = 4  # bytes
PLAIN = {
    "mode": '"peer"',
    "connect/timeout_ms": "0",
    "connect/exit_on_failure": "false",
    "scouting/multicast/enabled": "false",
    "transport/unicast/open_timeout": "300",
}


def command_in(datagram: bytes) -> tuple[bytes, bytes] | None:
    """Payload and attachment of a command of ours in a datagram, None if there is none to be read."""
    size, form = len(Attachment(0, 0, 0).to_bytes()), encode(STOP)
    at = datagram.find(MAGIC)
    begin = datagram.find(form[:CDR_HEADER], at + size)
    payload = datagram[begin : begin + len(form)]
    return (payload, datagram[at : at + size]) if min(at, begin) >= 0 and len(payload) == len(form) else None


class Intruder:
    """Puts commands of every kind on `cmd_vel`, with what it hears from the robot. What moves wheels here is noted."""

    def __init__(self, bus: Bus, journal: Path, keyring: "Keyring | None" = None) -> None:
        self._bus = bus
        self._keyring = keyring
        self._pen, self._thumb = Pen(journal, "intruder"), Pen(journal, "joystick")
        self._publisher = bus.publisher(CMD_VEL)
        self._applied = bus.reader(APPLIED)
        self._ended = threading.Event()
        self._background: list[threading.Thread] = []
        self._floods: list[subprocess.Popen[bytes]] = []

    def put_raw(self, payload: bytes) -> None:
        """Put what is no command."""
        self._repeat(lambda: self._bus.put_raw(CMD_VEL, payload))

    def rival(self) -> None:
        """Command to back off, with fresh stamps."""
        self._repeat(lambda: self._publisher.put(self._pen.mark(BACK), self._hear().stamp_s))

    def forge(self, ahead_s: float) -> None:
        """Command in the commander's place, with a copy of all that the robot tells of it: the session and numbers that
        it will come to, with stamps of so much ahead of now.
        """
        numbers = count(self._hear().seq + AHEAD)
        self._repeat(lambda: self._say(CMD_VEL, self._bus, told := self._hear(), next(numbers), told.stamp_s + ahead_s))

    def repeat(self, datagrams: Sequence[bytes]) -> int:
        """Say again the commands that are in these, the last again and again, at once and later; returns how many."""
        said = [found for data in datagrams if (found := command_in(data)) is not None]
        last = said[-1:] * TIMES
        for payload, attachment in [*last, *said, *last]:
            self._bus.put_raw(CMD_VEL, payload, attachment)
            time.sleep(PAUSE_S)
        return len(said)

    def take_lease(self) -> None:
        """Become the commander, and stand."""
        self._repeat(lambda: self._publisher.put(STOP, self._hear().stamp_s))

    def leave(self) -> None:
        """Let go of the lease."""
        self._publisher.put(STOP, self._hear().stamp_s, released=True)

    def idle_joystick(self) -> None:
        """Be a ROS joystick that nobody touches, from now on: zeros without an attachment."""
        self._go_on(lambda: self._bus.put_raw(TELEOP, encode(self._thumb.mark(STOP))))

    def flood(self, kind: str) -> None:
        """Send as much as fits through from now on, from two more processes."""
        endpoint, robot = self._bus.endpoint, self._bus.robot
        command = [sys.executable, "-m", flood.__name__, endpoint, robot, kind]
        for _ in range(2):
            self._floods.append(subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True))
        for process in self._floods:
            assert process.stdout is not None
            process.stdout.readline()  # it says that it has begun

    def rest(self) -> None:
        """End whatever goes on."""
        self._ended.set()
        for thread in self._background:
            thread.join(WAIT_S)
        for process in self._floods:
            process.send_signal(signal.SIGKILL)
            process.communicate()
        self._background, self._floods, self._ended = [], [], threading.Event()

    def close(self) -> None:
        """End everything."""
        self.rest()
        self._pen.close()
        self._thumb.close()

    def put_plainly(self) -> None:
        """Put with nothing but zenoh, as a script does that knows the key and has no certificate."""
        config = zenoh.Config()
        for key, value in PLAIN.items():
            config.insert_json5(key, value)
        config.insert_json5("connect/endpoints", f'["tcp/{self._bus.endpoint}", "udp/{self._bus.endpoint}"]')
        session = zenoh.open(config)
        self._repeat(lambda: session.put(f"{self._bus.robot}/{CMD_VEL.key}", encode(self._pen.mark(BACK))))
        threading.Thread(target=session.close, daemon=True).start()  # it takes its time while it tries to connect

    def put_as(self, who: str) -> None:
        """Put with the certificate of another peer."""
        bus = self._session_of(who)
        publisher = bus.publisher(CMD_VEL)
        self._wait_heard(publisher)
        self._repeat(lambda: publisher.put(self._pen.mark(BACK), self._hear().stamp_s))
        bus.close()

    def put_in_name(self, who: str, name: str) -> None:
        """Put in somebody's name, with the certificate of another who may drive, and all that the robot tells."""
        bus = self._session_of(who)
        self._wait_heard(bus.publisher(CMD_VEL))
        numbers = count(self._hear().seq + AHEAD)
        topic = named(CMD_VEL, name)
        self._repeat(lambda: self._say(topic, bus, told := self._hear(), next(numbers), told.stamp_s))
        bus.close()

    def release_as(self, who: str) -> None:
        """Release the emergency stop with the certificate of another peer, which may look at it; and wait a little."""
        bus = self._session_of(who)
        look_at_estop(bus, WAIT_S)
        with contextlib.suppress(BusError):  # an answer or none, it is all the same
            release_estop(bus, RELEASE_S)
        time.sleep(RELEASE_S)
        bus.close()

    def _session_of(self, who: str) -> Bus:
        assert self._keyring is not None
        return Bus(self._bus.robot, connect=self._bus.endpoint, keys=load_keys(self._keyring.prepare(who)))

    def _wait_heard(self, publisher: Publisher[Twist]) -> None:
        """Wait until the robot listens to it: what is put before goes nowhere, and proves nothing."""
        deadline_s = time.monotonic() + WAIT_S
        while not publisher.matching:
            if time.monotonic() > deadline_s:
                raise TimeoutError("the robot does not listen to the intruder")
            time.sleep(PAUSE_S)

    def _say(self, topic: Topic[Twist], bus: Bus, told: Applied, seq: int, stamp_s: float) -> None:
        """Command as if in the session of which the robot tells."""
        attachment = Attachment(told.session, seq, round(max(stamp_s, 0.0) * 1e9))
        bus.put_raw(topic, encode(self._pen.mark(BACK)), attachment.to_bytes())

    def _repeat(self, act: Callable[[], None]) -> None:
        for _ in range(TIMES):
            act()
            time.sleep(PAUSE_S)

    def _go_on(self, act: Callable[[], None]) -> None:
        ended = self._ended

        def run() -> None:
            while not ended.wait(IDLE_S):
                act()

        self._background.append(threading.Thread(target=run, daemon=True))
        self._background[-1].start()

    def _hear(self) -> Applied:
        deadline_s = time.monotonic() + WAIT_S
        while (newest := self._applied.newest()) is None:
            if time.monotonic() > deadline_s:
                raise TimeoutError("the robot says nothing about its wheels")
            time.sleep(PAUSE_S)
        return newest.message
