"""Bytes of a running scan become scans, each point with its time, and what there is to say of them."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from lira.hal.messages import LaserScan
from lira.hal.profile import Lidar
from lira.robot.rplidar.points import Decoder
from lira.robot.rplidar.turn import Turn, TurnCutter, scan_of

TURNS = 5  # whose median is the measured speed


@dataclass(slots=True)
class Counts:
    """What came and what was lost, since the driver was made."""

    points: int = 0
    turns: int = 0
    lost_bytes: int = 0
    dropped_turns: int = 0


class Stream:
    """One scan that runs. `sample_s` is the unit's time for a sample, `byte_s` the line's for a byte, 0 if unknown."""

    def __init__(
        self,
        decoder: Decoder,
        sample_s: float,
        byte_s: float,
        cutter: TurnCutter,
        lidar: Lidar,
        counts: Counts,
        *,
        ascending_time: bool = False,
    ) -> None:
        self._decoder = decoder
        self._sample_s = sample_s
        self._byte_s = byte_s
        self._cutter = cutter
        self._lidar = lidar
        self._counts = counts
        self._ascending_time = ascending_time
        self._newest_s = -math.inf
        self._middles_s: deque[float] = deque(maxlen=TURNS + 1)  # of turns
        self.newest: Turn | None = None
        self.rate_hz = math.nan  # turns per second of late; nan before the second. Another thread may ask
        self.turns = 0  # that were complete, shown or not

    def feed(self, data: bytes, now_s: float) -> list[LaserScan]:
        """Take what came by `now_s`, and return the scans that it completes."""
        decoder = self._decoder
        points = decoder.feed(data)
        self._counts.lost_bytes += points.lost
        if not len(points):
            return []
        self._counts.points += len(points)
        # The newest packet's last sample was taken before it went on the line, and what follows it came after that.
        newest_s = now_s - self._byte_s * (decoder.size + decoder.left % decoder.size)
        back = points.waiting + np.arange(len(points))[::-1]
        # Time does not run back when the line delivers in bursts.
        time_s = np.maximum(newest_s - back * self._sample_s, self._newest_s)
        self._newest_s = float(time_s[-1])
        scans = []
        for turn in self._cutter.add(points.theta_rad, points.distance_m, time_s):
            self.turns += 1
            self.newest = turn
            self._middles_s.append(float(np.mean(turn.time_s)))
            self.rate_hz = self._measured_hz()
            scan = scan_of(turn, self._lidar, ascending_time=self._ascending_time)
            if scan is None:
                self._counts.dropped_turns += 1
            else:
                self._counts.turns += 1
                scans.append(scan)
        return scans

    def _measured_hz(self) -> float:
        period_s = float(np.median(np.diff(self._middles_s))) if len(self._middles_s) > 1 else 0.0
        return 1.0 / period_s if period_s > 0.0 else math.nan

    @property
    def swept_rad(self) -> float:
        """How far the head has come since the newest turn."""
        return self._cutter.swept_rad
