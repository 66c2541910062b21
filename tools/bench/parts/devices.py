"""The robot's lidar and base on pseudo-terminals, in a process of their own: as on the robot, their time is not ours.

`python -m lira.tools.bench.parts.devices FOLDER MODE` says `ready`, and once told to stop it writes `journal.json`.
"""

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lira.hal.messages import Odometry
from lira.hal.signals import stop_on_signal
from lira.sim_backend.emulators.core2 import Core2Unit, Firmware
from lira.sim_backend.emulators.rplidar import RplidarUnit
from lira.sim_backend.emulators.rplidar_models import DENSE_MODE, STANDARD_MODE, ULTRA_MODE, Model
from lira.sim_backend.emulators.wire import Wire
from lira.sim_backend.polyline import Floats
from lira.tools.launch.processes import ChildProcess

# As fast as the line of each carries; a dense stream of 16,000 samples a second would not fit.
PLAIN = Model(triangulates=False)  # what it measures are numbers, not places
UNITS = {
    "standard": replace(PLAIN, modes=(STANDARD_MODE,)),
    "express": PLAIN,
    "ultra": replace(PLAIN, modes=(STANDARD_MODE, ULTRA_MODE)),
    "ultra-16k": replace(PLAIN, baud=256000, modes=(STANDARD_MODE, replace(ULTRA_MODE, sample_s=63e-6))),
    "dense": replace(PLAIN, baud=256000, modes=(STANDARD_MODE, replace(DENSE_MODE, sample_s=100e-6))),
}
"""By the name of what the driver takes of their modes, which is the last."""
READY_S = 30.0

# Distances count up by a millimetre from one sample to the next, so that whoever reads them sees what is missing.
FIRST_MM, COUNT = 2000, 8000


class Counting:
    """What the laser meets: the number of the sample."""

    def __init__(self) -> None:
        self._next = 0

    def __call__(self, theta_rad: Floats) -> Floats:
        """Distances in metres [n] of the next n samples."""
        number = self._next + np.arange(len(theta_rad))
        self._next += len(theta_rad)
        return np.asarray((FIRST_MM + number % COUNT) / 1000.0)


class NotedLidar(RplidarUnit):
    """Notes when how many samples had been put on the line."""

    def __init__(self, model: Model) -> None:
        super().__init__(Counting(), model)
        self.began_s = 0.0
        self.course = self.head.course
        self.notes: list[tuple[float, int]] = []

    def emit(self, now_s: float) -> bytes:
        """Return what is due."""
        data = super().emit(now_s)
        began_s, sent = self.progress
        if began_s != self.began_s:
            self.began_s, self.notes, self.course = began_s, [], self.head.course
        if data and sent:
            self.notes.append((time.monotonic(), sent))
        return data


@dataclass(frozen=True, slots=True)
class Journal:
    """When the stream began, (time, samples on the line) after each piece of it, and bytes that nobody fetched.

    `course` is the head's: since when it has turned how fast (Hz), and how many turns it had made by then.
    """

    began_s: float
    notes: list[tuple[float, int]]
    overflowed: int
    course: tuple[float, float, float]


class Devices:
    """The other process, seen from here. `lidar` and `base` are paths to open."""

    def __init__(self, folder: Path, child: ChildProcess) -> None:
        self.lidar, self.base = folder / "rplidar", folder / "core2"
        self._folder = folder
        self._child = child

    def stop(self) -> Journal:
        """End it; returns what it noted."""
        self._child.stop()
        found = json.loads((self._folder / "journal.json").read_text(encoding="utf-8"))
        notes = [(at_s, sent) for at_s, sent in found["notes"]]
        return Journal(found["began_s"], notes, found["overflowed"], tuple(found["course"]))


@contextmanager
def devices(folder: Path, mode: str) -> Iterator[Devices]:
    """Start the process, with one of the `UNITS`."""
    command = [sys.executable, "-m", "lira.tools.bench.parts.devices", str(folder), mode]
    with ChildProcess("the devices", command, folder / "devices.log") as child:
        child.wait_ready("ready", READY_S)
        yield Devices(folder, child)


def main(folder: Path, mode: str) -> None:
    """Be the devices until told to stop."""
    lidar = NotedLidar(UNITS[mode])
    odom = Odometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    with stop_on_signal() as stop:
        wires = [Wire(folder / "rplidar", lidar)]
        wires.append(Wire(folder / "core2", Core2Unit(lambda _: None, lambda: odom, Firmware(boot_s=0.1))))
        print("ready", flush=True)
        stop.wait()
        for wire in wires:
            wire.close()
    journal = {"began_s": lidar.began_s, "notes": lidar.notes, "overflowed": wires[0].overflowed}
    journal["course"] = lidar.course
    (folder / "journal.json").write_text(json.dumps(journal), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
