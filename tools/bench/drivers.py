"""The drivers: what share of a core the parsers need, and how old a scan is when it is handed on."""

import math
import statistics
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from hal.messages import LaserScan, Odometry
from hal.profile import load_profile
from robot.core2.board import Board
from robot.core2.rosserial import parse_frames
from robot.rplidar.device import Counts, RPLidar, Stream
from robot.rplidar.points import PARSERS
from robot.rplidar.protocol import Answer
from robot.rplidar.turn import Mounting, TurnCutter
from robot.settings import BaseSettings, LidarSettings
from sim_backend.emulators.core2 import Core2Unit, Firmware
from sim_backend.emulators.rplidar import DENSE_MODE, EXPRESS_MODE, STANDARD_MODE, Model, RplidarUnit, ScanMode
from sim_backend.emulators.wire import Wire
from tools.bench import Row

RUNS = 5
STREAM_S = 10.0
PIECE_S = 0.004  # what a read of a serial port brings at once
LIVE_S = 10.0
MODES = {"standard": STANDARD_MODE, "express": EXPRESS_MODE, "dense": DENSE_MODE}


def run() -> list[Row]:
    """Return a row for each kind of stream, and one for a live unit."""
    rows = [parse_scan(name, mode) for name, mode in MODES.items()]
    return [*rows, parse_base(), live_scan()]


def parse_scan(name: str, mode: ScanMode) -> Row:
    """Parse a stream as it comes in small pieces, and cut it into scans."""
    pieces = record(mode)
    lidar = load_profile("rosbot2").lidar
    counts, shares = Counts(), []
    for _ in range(RUNS):
        counts = Counts()
        cutter = TurnCutter(Mounting())
        stream = Stream(PARSERS[Answer(mode.answer)], mode.sample_s, cutter, lidar, counts)
        began_s = time.process_time()
        for number, piece in enumerate(pieces):
            stream.feed(piece, number * PIECE_S)
        shares.append((time.process_time() - began_s) / STREAM_S)
    return {
        "stream": f"lidar, {name}",
        "per_s": counts.points / STREAM_S,
        "core_percent": 100 * statistics.median(shares),
        "lost_bytes": counts.lost_bytes,
        "scans": counts.turns,
    }


def record(mode: ScanMode) -> list[bytes]:
    """What a unit sends, in pieces of a few milliseconds."""
    unit = RplidarUnit(lambda theta: 2.0 + np.sin(theta), Model(modes=(mode,)))
    unit.pwm, unit.mode = 660, mode
    return [unit.emit(number * PIECE_S) for number in range(1, round(STREAM_S / PIECE_S) + 1)]


def parse_base() -> Row:
    """Read what a CORE2 sends."""
    unit = Core2Unit(lambda _: None, lambda: Odometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), Firmware(boot_s=0.0))
    unit.receive(b"", 0.0)
    unit.receive(bytes.fromhex("fffe0000ff0000ff"), 0.0)
    ticks = np.arange(0.0, STREAM_S, PIECE_S).tolist()
    pieces = [unit.emit(now_s) for now_s in ticks]
    shares, frames = [], 0
    for _ in range(RUNS):
        board, buffer, frames = Board(BaseSettings()), b"", 0
        began_s = time.process_time()
        for now_s, piece in zip(ticks, pieces, strict=True):
            parsed = parse_frames(buffer + piece)
            buffer = (buffer + piece)[parsed.consumed :]
            frames += len(parsed.frames)
            for frame in parsed.frames:
                board.handle(frame, now_s)
        shares.append((time.process_time() - began_s) / STREAM_S)
    return {"stream": "base", "per_s": frames / STREAM_S, "core_percent": 100 * statistics.median(shares)}


def live_scan() -> Row:
    """Let the driver read a dense unit on a pseudo-terminal; ages are from a turn's last point to the scan."""
    ages_ms: list[float] = []

    def put(scan: LaserScan) -> None:
        ages_ms.append(1e3 * (time.monotonic() - (scan.stamp_s + max(scan.time_increment, 0.0) * len(scan.ranges))))

    with tempfile.TemporaryDirectory() as folder:
        unit = RplidarUnit(lambda theta: 2.0 + np.sin(theta), Model(modes=(STANDARD_MODE, DENSE_MODE)))
        wire = Wire(Path(folder) / "rplidar", unit)
        lidar = load_profile("rosbot2").lidar
        driver = RPLidar(str(Path(folder) / "rplidar"), lidar, LidarSettings(spin_up_s=0.0), put)
        stop = threading.Event()
        timer = threading.Timer(LIVE_S, stop.set)
        timer.start()
        try:
            driver.session(stop, lambda: None)
        finally:
            timer.cancel()
            wire.close()
    return {
        "stream": "lidar, dense, live",
        "per_s": driver.counts.points / LIVE_S,
        "lost_bytes": driver.counts.lost_bytes + wire.overflowed,
        "scans": driver.counts.turns,
        "age_ms_p50": float(np.percentile(ages_ms, 50)) if ages_ms else math.nan,
        "age_ms_p99": float(np.percentile(ages_ms, 99)) if ages_ms else math.nan,
    }
