"""How old a scan is when the robot has published it, and where the time went; and whether any sample is missing.

The lidar is another process, `lira robot` a second one, and this one listens on the bus. All stamp with the monotonic
clock of the machine. The age runs from the moment at which the unit took the last sample of a turn.
"""

import math
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import SCAN
from lira.hal.clock import unix_offset_s
from lira.hal.profile import load_profile
from lira.robot.rplidar.decoders import DECODERS
from lira.robot.rplidar.device import RPLidar
from lira.robot.rplidar.points import Decoder, Points
from lira.robot.rplidar.protocol import Answer
from lira.robot.settings import LidarSettings
from lira.sim_backend.emulators.rplidar_head import behind
from lira.tools.bench import Row
from lira.tools.bench.parts.devices import COUNT, FIRST_MM, UNITS, Journal, devices
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

SEAM_TURNS = 0.5  # behind the robot
MIDDLE_M = (FIRST_MM + COUNT / 2) / 1000
ARRIVAL_S = 10.0
POLL_S = 0.001
QUICK = "[lidar]\nspin_up_s = 0.0\n[base]\nboot_s = 0.2\n"


def live(mode: str, seconds: float) -> Row:
    """Ages of the scans that `lira robot` publishes.

    `age_ms` is the whole; `unit_ms` of it is the unit's (until its packets were complete and on the line), `robot_ms`
    is ours (from there until the scan was on the bus).
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        port = free_port()
        robot, endpoint = f"bench_{port}", f"127.0.0.1:{port}"
        (folder / "quick.toml").write_text(QUICK, encoding="utf-8")
        with devices(folder, mode) as there:
            words = ["--lidar", str(there.lidar), "--base", str(there.base), "--without", "camera"]
            words += ["--settings", str(folder / "quick.toml"), "--name", robot, "--listen", endpoint]
            with ChildProcess("the robot", lira_command("robot", *words), folder / "lira.robot.log") as child:
                child.wait_ready("serves", 60.0)
                scans = listen(robot, endpoint, seconds)
            journal = there.stop()
    return {"stream": f"lidar, {mode}, live", "scans": len(scans)} | ages(scans, journal, mode)


def listen(robot: str, endpoint: str, seconds: float) -> list[tuple[float, float]]:
    """Stamp and time of publication of every scan, once they come, on this machine's monotonic clock."""
    ahead_s = unix_offset_s(time.monotonic)  # as the robot measured it: on the bus times count from 1970
    bus = Bus(robot, connect=endpoint)
    reader = bus.reader(SCAN, depth=16)
    scans: list[tuple[float, float]] = []
    until_s = time.monotonic() + ARRIVAL_S
    while time.monotonic() < until_s:
        for received in reader.poll():
            if not scans:
                until_s = time.monotonic() + seconds
            if received.attachment is not None:
                scans.append((received.message.stamp_s - ahead_s, received.attachment.time_s - ahead_s))
        time.sleep(POLL_S)
    bus.close()
    return scans


def ages(scans: list[tuple[float, float]], journal: Journal, mode: str) -> Row:
    """Ages of scans by the unit's own clockwork. Pure."""
    unit = UNITS[mode]
    scanned = unit.modes[-1]
    decoder = DECODERS[Answer(scanned.answer)](scanned.sample_s)
    since_s, rate_hz, turns = journal.course
    # Where the head looks when its points pass the seam: the ultra stream leaves it to the driver how far they are
    # behind. The turn is closed as far beyond that as angles may step back.
    behind_rad = float(behind(np.array(MIDDLE_M))) if scanned.answer == Answer.ULTRA else 0.0
    seam_turns = SEAM_TURNS + behind_rad / math.tau
    closed_turns = seam_turns + decoder.back_rad / math.tau
    sent = np.array([count for _, count in journal.notes])

    def first_after(turn: float) -> int:
        """Number of the first sample that was taken from that turn of the head on."""
        at_s = since_s + (turn - turns) / rate_hz
        return math.ceil((at_s - journal.began_s) / scanned.sample_s)

    ages_ms, units_ms, robots_ms = [], [], []
    for stamp_s, published_s in scans:
        # The stamp is that of the turn's last sample, as near as the driver can tell: it says which turn this is.
        turn = round(turns + (stamp_s - since_s) * rate_hz - seam_turns)
        taken_s = journal.began_s + (first_after(turn + seam_turns) - 1) * scanned.sample_s
        needed = (first_after(turn + closed_turns) // scanned.points + 1) * scanned.points
        at = int(np.searchsorted(sent, needed))
        if at < len(sent):
            on_line_s = journal.notes[at][0]
            ages_ms.append(1e3 * (published_s - taken_s))
            units_ms.append(1e3 * (on_line_s - taken_s))
            robots_ms.append(1e3 * (published_s - on_line_s))
    row: Row = {}
    for name, values in (("age_ms", ages_ms), ("unit_ms", units_ms), ("robot_ms", robots_ms)):
        for percent in (50, 99):
            row[f"{name}_p{percent}"] = float(np.percentile(values, percent)) if values else math.nan
    return row


class Checked:
    """A decoder that knows which sample has to come next, and counts those that do not."""

    def __init__(self, decoder: Decoder) -> None:
        self._decoder = decoder
        self.size, self.back_rad = decoder.size, decoder.back_rad
        self._newest: int | None = None
        self.missing = 0

    @property
    def left(self) -> int:
        """Bytes that wait for more."""
        return self._decoder.left

    def feed(self, data: bytes) -> Points:
        """Decode as the driver does."""
        points = self._decoder.feed(data)
        if len(points):
            number = np.rint(points.distance_m * 1000).astype(np.int64) - FIRST_MM
            before = number[:1] - 1 if self._newest is None else [self._newest]
            self.missing += int(np.sum((np.diff(np.concatenate([before, number])) - 1) % COUNT))
            self._newest = int(number[-1])
        return points


def endurance(mode: str, seconds: float) -> Row:
    """Read a unit for so long, and count every sample that is missing."""
    made: list[Checked] = []

    def make(sample_s: float) -> Decoder:
        made.append(Checked(DECODERS[answer](sample_s)))
        return made[-1]

    answer = Answer(UNITS[mode].modes[-1].answer)
    with tempfile.TemporaryDirectory() as name, devices(Path(name), mode) as there:
        lidar = load_profile("rosbot2").lidar
        settings = LidarSettings(spin_up_s=0.0)
        driver = RPLidar(str(there.lidar), lidar, settings, lambda _: None, {**DECODERS, answer: make})
        stop = threading.Event()
        timer = threading.Timer(seconds, stop.set)
        timer.start()
        try:
            driver.session(stop, lambda: None)
        finally:
            timer.cancel()
        journal = there.stop()
    return {
        "stream": f"lidar, {mode}, {seconds / 60:.3g} min at {UNITS[mode].baud} baud",
        "points": driver.counts.points,
        "missing": sum(decoder.missing for decoder in made),
        "lost_bytes": driver.counts.lost_bytes + journal.overflowed,
        "scans": driver.counts.turns,
    }
