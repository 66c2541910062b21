"""From the press of the dead-man to `cmd_vel/applied`, on loopback, while a policy drives.

The robot runs in a process of its own. `pad`: a pipe that carries what the kernel would send; `web`: a client at the
socket of `lira web`, a process of its own, that says what a page says, as often as a page does. A sample ends when
the robot's word that the hand drives has arrived back here, so it counts the way there and the way back.
"""

import os
import random
import select
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

import numpy as np

from lira.hal.bus.reader import Reader
from lira.hal.bus.topics import APPLIED
from lira.hal.client.connect import connect, on_bus
from lira.hal.errors import BusError
from lira.hal.messages import HELD, STOP, Applied, Command, Source, Twist
from lira.tools.bench import Row
from lira.tools.bench.parts import page
from lira.tools.bench.parts.robots import null_robot_at_work
from lira.tools.joystick.axes import AxisRange, PadEvent, PadState
from lira.tools.joystick.bridge import Bridge
from lira.tools.joystick.client import TeleopClient
from lira.tools.joystick.known_pads import PadMemory
from lira.tools.joystick.pads.codes import AXES, BUTTONS, EV_ABS, EV_KEY, EV_SYN
from lira.tools.joystick.pads.mapping import load_mapping
from lira.tools.launch.threads import in_thread

SAMPLES = 150
WARM_UP = 5
READY_S = 30.0
LIMIT_S = 5.0
MISSED = 3
POLL_S = 0.0005
REPORT = struct.Struct("<HHi")


class Thumb(Protocol):
    """What takes control, by whatever way."""

    def press(self) -> None:
        """Hold the dead-man, and drive ahead."""

    def let_go(self) -> None:
        """Give control back."""


class PipePad:
    """A pad at the end of a pipe."""

    name = key = "a pipe"
    has_motion = False
    motion_trouble = ""

    def __init__(self) -> None:
        self._read_fd, self._write_fd = os.pipe()
        self.state = PadState({0: AxisRange(), 1: AxisRange()}, {0: 128, 1: 128})
        self.mapping = load_mapping("ps3")

    def send(self, *events: tuple[int, int, int]) -> None:
        """One report, as a thumb would cause it."""
        os.write(self._write_fd, b"".join(REPORT.pack(*event) for event in (*events, (EV_SYN, 0, 0))))

    def press(self) -> None:
        """Hold the dead-man, and the stick ahead."""
        self.send((EV_ABS, AXES["ABS_Y"], 0), (EV_KEY, BUTTONS[self.mapping.dead_man], 1))

    def let_go(self) -> None:
        """Off the dead-man, with the stick at rest."""
        self.send((EV_ABS, AXES["ABS_Y"], 128), (EV_KEY, BUTTONS[self.mapping.dead_man], 0))

    def fileno_list(self) -> list[int]:
        """What to wait for."""
        return [self._read_fd]

    def read(self) -> tuple[list[PadState], bool]:
        """States after each report. To be called when there is something to read."""
        states = []
        if select.select([self._read_fd], [], [], 0.0)[0]:
            for event in REPORT.iter_unpack(os.read(self._read_fd, REPORT.size * 64)):
                self.state = self.state.after(PadEvent(*event))
                if event[0] == EV_SYN:
                    states.append(self.state)
        return states, bool(states)

    def rumble(self, strength: float) -> None:
        """A pipe has no motors."""

    def close(self) -> None:
        """Close both ends."""
        os.close(self._read_fd)
        os.close(self._write_fd)


def run() -> list[Row]:
    """Return a row for the pad and one for the page."""
    with null_robot_at_work() as (name, endpoint, folder):
        pad = PipePad()
        with policy(name, endpoint):
            with bridge(name, endpoint, pad):
                by_pad = measure(name, endpoint, pad)
            with page.page_of(name, endpoint, folder) as thumb:
                by_page = measure(name, endpoint, thumb)
    return [row("pad", by_pad), row("web", by_page)]


def row(by: str, taken_ms: list[float]) -> Row:
    """What it takes by one way."""
    p50, p99 = (float(np.percentile(taken_ms, q)) for q in (50, 99))
    return {"by": by, "samples": len(taken_ms), "p50_ms": p50, "p99_ms": p99, "max_ms": max(taken_ms)}


def measure(name: str, endpoint: str, thumb: Thumb) -> list[float]:
    """Take control from a driving policy and give it back, again and again, at moments without a rhythm."""
    rng = random.Random(0)
    taken_ms: list[float] = []
    missed = 0
    with on_bus(endpoint, name, watch=True) as bus:
        applied = bus.reader(APPLIED, depth=64)
        while len(taken_ms) < SAMPLES + WARM_UP:
            until(applied, lambda result: result.source is Source.POLICY and result.twist != STOP)
            time.sleep(rng.uniform(0.02, 0.12))
            applied.poll()
            pressed_s = time.monotonic()
            thumb.press()
            try:
                arrived_s = until(applied, lambda result: result.source is Source.TELEOP and result.twist != STOP)
            except BusError:  # a busy machine stopped the robot, which now waits for a stick at rest
                missed += 1
                if missed > MISSED:
                    raise
            else:
                taken_ms.append(1e3 * (arrived_s - pressed_s))
            thumb.let_go()
    return taken_ms[WARM_UP:]


def until(reader: Reader[Applied], condition: Callable[[Applied], bool]) -> float:
    """Wait for a result and return when it arrived. Raises `BusError` if it does not come."""
    deadline_s = time.monotonic() + LIMIT_S
    while time.monotonic() < deadline_s:
        for received in reader.poll():
            if condition(received.message):
                return received.arrived_s
        time.sleep(POLL_S)
    raise BusError("control was not handed over", "Is the machine overloaded?")


@contextmanager
def policy(name: str, endpoint: str) -> Iterator[None]:
    """Something that drives at the robot's control rate."""
    with connect(endpoint, name) as robot:
        stop = threading.Event()

        def drive() -> None:
            go = STOP
            while not stop.is_set():
                applied = robot.drive(Command(go, robot.now(), answers=robot.read().seq))
                robot.wait(robot.now() + robot.profile.period_s)
                # A robot that stopped by itself waits for a zero.
                go = STOP if applied.reason in HELD else Twist(0.5 * robot.profile.base.max_linear_m_s, 0.0)

        with in_thread(drive, stop):
            yield


@contextmanager
def bridge(name: str, endpoint: str, pad: PipePad) -> Iterator[None]:
    """The bridge on that pad."""
    with on_bus(endpoint, name) as bus, on_bus(endpoint, name, watch=True) as watch:
        stop = threading.Event()
        loop = Bridge(TeleopClient(bus, watch, READY_S, lambda _: None), lambda: pad, PadMemory(None), lambda _: None)
        with in_thread(lambda: loop.run(stop), stop):
            yield
