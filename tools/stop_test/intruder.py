"""Somebody else on the bus, who means no good; with keys, also somebody who has none, or not the right ones."""

import contextlib
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import zenoh

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.bus import Bus, Received
from lira.hal.bus.keys import load_keys
from lira.hal.bus.services import look_at_estop, release_estop
from lira.hal.bus.topics import APPLIED, CMD_VEL, TELEOP
from lira.hal.errors import BusError
from lira.hal.messages import STOP, Applied, Twist
from lira.hal.messages.codec import encode
from lira.tools.stop_test import flood
from lira.tools.stop_test.sender import Pen

if TYPE_CHECKING:
    from lira.tools.stop_test.keyring import Keyring

TIMES = 15
PAUSE_S = 0.02
IDLE_S = 0.05
BACK = Twist(-0.1, 0.0)
WAIT_S, RELEASE_S = 5.0, 0.5
EAVESDROP_S = 0.3
AHEAD = 40  # messages: numbers that the commander will come to within a few seconds
DEPTH = 256
PLAIN = {
    "mode": '"peer"',
    "connect/timeout_ms": "0",
    "connect/exit_on_failure": "false",
    "scouting/multicast/enabled": "false",
    "transport/unicast/open_timeout": "300",
}


class Intruder:
    """Puts commands of every kind on `cmd_vel`, with what it hears from the robot. What moves wheels here is noted."""

    def __init__(self, bus: Bus, journal: Path, keyring: "Keyring | None" = None) -> None:
        self._bus = bus
        self._keyring = keyring
        self._pen, self._thumb = Pen(journal, "intruder"), Pen(journal, "joystick")
        self._publisher = bus.publisher(CMD_VEL)
        self._applied = bus.reader(APPLIED)
        self._recorded: list[Received[Twist]] = []
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
        """Command in the commander's name, as whoever listens to it can, with stamps of so much ahead of now."""
        self.record(EAVESDROP_S)
        sent = [received.attachment for received in self._recorded if received.attachment is not None]
        self._recorded = []
        epoch, seq = (sent[-1].epoch, sent[-1].seq) if sent else (0, 0)
        numbers = count(seq + AHEAD)
        self._repeat(lambda: self._say_as(epoch, next(numbers), self._hear().stamp_s + ahead_s))

    def record(self, for_s: float) -> None:
        """Listen to what the commander says, as whoever is let in as a watcher may."""
        watch = Bus(self._bus.robot, connect=self._bus.endpoint, watch=True)
        reader, until_s = watch.reader(CMD_VEL, DEPTH), time.monotonic() + for_s
        while time.monotonic() < until_s:
            self._recorded += reader.poll()
            time.sleep(PAUSE_S)
        watch.close()

    def replay_recorded(self) -> None:
        """Say all of it again, and the last word again and again, at once and later."""
        recorded, self._recorded = self._recorded, []
        if not recorded:
            raise TimeoutError("nothing was recorded of what the commander says")
        last = recorded[-1:] * TIMES
        for received in [*last, *recorded, *last]:
            attached = None if received.attachment is None else received.attachment.to_bytes()
            self._bus.put_raw(CMD_VEL, encode(received.message), attached)
            time.sleep(PAUSE_S)

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
        publisher, deadline_s = bus.publisher(CMD_VEL), time.monotonic() + WAIT_S
        while not publisher.matching and time.monotonic() < deadline_s:
            time.sleep(PAUSE_S)
        self._repeat(lambda: publisher.put(self._pen.mark(BACK), self._hear().stamp_s))
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

    def _say_as(self, epoch: int, seq: int, stamp_s: float) -> None:
        attachment = Attachment(epoch, seq, round(max(stamp_s, 0.0) * 1e9))
        self._bus.put_raw(CMD_VEL, encode(self._pen.mark(BACK)), attachment.to_bytes())

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
