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
from lira.hal.profile import load_profile
from lira.robot.rplidar.device import RPLidar
from lira.robot.rplidar.points import PARSERS, Parser, Points
from lira.robot.settings import LidarSettings
from lira.tools.bench import Row
from lira.tools.bench.parts.devices import COUNT, FIRST_MM, MODES, Journal, devices
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

RATE_HZ = 10.0  # of the emulated head
SEAM_TURNS = 0.5  # behind the robot
WAITING_PACKETS = 2  # the packet with the first sample of the next turn, and the one that gives it its angle
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
    """Stamp and time of publication of every scan, once they come."""
    bus = Bus(robot, connect=endpoint)
    reader = bus.reader(SCAN, depth=16)
    scans: list[tuple[float, float]] = []
    until_s = time.monotonic() + ARRIVAL_S
    while time.monotonic() < until_s:
        for received in reader.poll():
            if not scans:
                until_s = time.monotonic() + seconds
            if received.attachment is not None:
                scans.append((received.message.stamp_s, received.attachment.time_s))
        time.sleep(POLL_S)
    bus.close()
    return scans


def ages(scans: list[tuple[float, float]], journal: Journal, mode: str) -> Row:
    """Ages of scans by the unit's own clockwork. Pure."""
    sample_s, points = MODES[mode].sample_s, MODES[mode].points
    sent = np.array([count for _, count in journal.notes])
    ages_ms, units_ms, robots_ms = [], [], []
    for stamp_s, published_s in scans:
        # The stamp is that of the turn's last sample, as near as the driver can tell: it says which turn this is.
        turn = round(stamp_s * RATE_HZ - SEAM_TURNS)
        after = math.ceil(((turn + SEAM_TURNS) / RATE_HZ - journal.began_s) / sample_s)
        taken_s = journal.began_s + (after - 1) * sample_s
        needed = (after // points + WAITING_PACKETS) * points
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
    """A parser that knows which sample has to come next, and counts those that do not."""

    def __init__(self, parse: Parser) -> None:
        self._parse = parse
        self._newest: int | None = None
        self.missing = 0

    def __call__(self, buffer: bytes, usual_deg: float = math.inf) -> Points:
        """Parse as the driver does."""
        points = self._parse(buffer, usual_deg)
        if len(points):
            number = np.rint(points.distance_m * 1000).astype(np.int64) - FIRST_MM
            before = number[:1] - 1 if self._newest is None else [self._newest]
            self.missing += int(np.sum((np.diff(np.concatenate([before, number])) - 1) % COUNT))
            self._newest = int(number[-1])
        return points


def endurance(mode: str, seconds: float) -> Row:
    """Read a unit for so long, and count every sample that is missing."""
    parsers = {answer: Checked(parse) for answer, parse in PARSERS.items()}
    with tempfile.TemporaryDirectory() as name, devices(Path(name), mode) as there:
        lidar = load_profile("rosbot2").lidar
        driver = RPLidar(str(there.lidar), lidar, LidarSettings(spin_up_s=0.0), lambda _: None, parsers)
        stop = threading.Event()
        timer = threading.Timer(seconds, stop.set)
        timer.start()
        try:
            driver.session(stop, lambda: None)
        finally:
            timer.cancel()
        journal = there.stop()
    return {
        "stream": f"lidar, {mode}, {seconds / 60:.3g} min at 115200 baud",
        "points": driver.counts.points,
        "missing": sum(parser.missing for parser in parsers.values()),
        "lost_bytes": driver.counts.lost_bytes + journal.overflowed,
        "scans": driver.counts.turns,
    }
