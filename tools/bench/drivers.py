"""The drivers: what share of a core the parsers need, how old a scan is when it is published, what a line loses."""

import statistics
import time

import numpy as np

from lira.hal.messages import Odometry
from lira.hal.profile import load_profile
from lira.robot.core2.board import Board
from lira.robot.core2.rosserial import parse_frames
from lira.robot.rplidar.decoders import DECODERS
from lira.robot.rplidar.protocol import Answer
from lira.robot.rplidar.stream import Counts, Stream
from lira.robot.rplidar.turn import Mounting, TurnCutter
from lira.robot.settings import BaseSettings
from lira.sim_backend.emulators.core2 import Core2Unit, Firmware
from lira.sim_backend.emulators.rplidar import RplidarUnit
from lira.sim_backend.emulators.rplidar_models import DENSE_MODE, Model
from lira.tools.bench import Row
from lira.tools.bench.parts.devices import UNITS
from lira.tools.bench.parts.scan_age import endurance, live

RUNS = 5
STREAM_S = 10.0
PIECE_S = 0.004  # what a read of a serial port brings at once
LIVE_S = 10.0
LINE_MINUTES = 0.25
FAST = 1_000_000  # baud: more than the stream needs


def run(minutes: float = LINE_MINUTES) -> list[Row]:
    """Return a row for each kind of stream, for scans that a robot publishes, and for samples lost in so many minutes.

    At 115200 baud the ultra stream is the nearest to what the line carries.
    """
    parsed = {**UNITS, "dense-16k": Model(baud=FAST, modes=(DENSE_MODE,))}
    rows = [*(parse_scan(name, model) for name, model in parsed.items()), parse_base()]
    rows += [live(mode, LIVE_S) for mode in UNITS]
    return [*rows, endurance("express", 60 * minutes)]


def parse_scan(name: str, model: Model) -> Row:
    """Parse a stream as it comes in small pieces, and cut it into scans."""
    mode = model.modes[-1]
    pieces = record(model)
    lidar = load_profile("rosbot2").lidar
    counts, shares = Counts(), []
    for _ in range(RUNS):
        counts = Counts()
        decoder = DECODERS[Answer(mode.answer)](mode.sample_s)
        cutter = TurnCutter(Mounting(), decoder.back_rad)
        stream = Stream(decoder, mode.sample_s, 10 / model.baud, cutter, lidar, counts)
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


def record(model: Model) -> list[bytes]:
    """What a unit sends in its last mode, in pieces of a few milliseconds."""
    unit = RplidarUnit(lambda theta: 2.0 + np.sin(theta), model)
    unit.begin(model.modes[-1], 660, 0.0)
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
