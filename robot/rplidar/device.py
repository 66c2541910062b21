"""The RPLIDAR on its line: bring it up, read its turns, hold its speed, and stop it for certain."""

import contextlib
import math
import threading
import time
from collections.abc import Callable, Mapping

import numpy as np

from lira.hal.errors import DeviceError
from lira.hal.messages import DiagnosticStatus, LaserScan
from lira.hal.profile import Lidar
from lira.robot.rplidar import protocol
from lira.robot.rplidar.decoders import DECODERS, MakeDecoder
from lira.robot.rplidar.protocol import Answer, Health, Info
from lira.robot.rplidar.speed import SpeedRegulator, TurnWatchdog
from lira.robot.rplidar.stream import Counts, Stream
from lira.robot.rplidar.turn import Mounting, TurnCutter
from lira.robot.rplidar.unit import BAUDS, Mode, Unit, leave
from lira.robot.serial_port import Line
from lira.robot.settings import LidarSettings

READ_S = 0.1
# A unit that falls silent so soon after its motor was told another speed has taken that for the end of the scan.
ENDED_S, BLAME_S = 0.15, 1.0
OK, WARN = 0, 1


class RPLidar:
    """Reads turns from a unit at `url` (a serial port, or `socket://host:port`) and hands each scan to `put`.

    `session` and `rest` are for a `Supervisor`. `decoders` read the streams that are understood.
    """

    def __init__(
        self,
        url: str,
        lidar: Lidar,
        settings: LidarSettings,
        put: Callable[[LaserScan], None],
        decoders: Mapping[Answer, MakeDecoder] = DECODERS,
    ) -> None:
        self._url = url
        self._lidar = lidar
        self._settings = settings
        self._put = put
        self._decoders = decoders
        self._turning = False  # the motor was switched on, and not off again
        self._unread: set[Answer] = set()  # what began and was never understood
        self._stream: Stream | None = None
        self._speed: SpeedRegulator | None = None
        self._scan: LaserScan | None = None
        self.counts = Counts()
        self.baud = BAUDS[0]
        self.info: Info | None = None
        self.health: tuple[Health, int] | None = None
        self.mode: Mode | None = None

    def session(self, stop: threading.Event, begin: Callable[[], None]) -> None:
        """Open, scan until `stop` is set or the unit is lost, and leave it. Raises `DeviceError`.

        The head of a unit that was lost goes on turning: the next session need not wait for it again.
        """
        line = Line(self._url, BAUDS[0])
        try:
            unit = Unit(line)
            self.info = unit.identify()
            self.baud = line.baud
            self.health = unit.check_health()
            speed = self._settings.motor_pwm if unit.hears_motor(self.info) else None
            line.write(protocol.encode_motor(self._settings.motor_pwm))
            turning, self._turning = self._turning, True
            if not turning and stop.wait(self._settings.spin_up_s):
                return
            self.mode, rest = unit.start(self.info, self._unread)
            self._read(line, unit, self.mode, rest, speed, stop, begin)
        finally:
            leave(line, turning=not stop.is_set())
            self._turning &= not stop.is_set()

    def rest(self) -> None:
        """Stop the head that a lost session has left turning, if it can be reached."""
        if self._turning:
            self._turning = False
            with contextlib.suppress(DeviceError):
                leave(Line(self._url, self.baud), turning=False)

    def _read(
        self,
        line: Line,
        unit: Unit,
        mode: Mode,
        rest: bytes,
        duty: int | None,
        stop: threading.Event,
        begin: Callable[[], None],
    ) -> None:
        """Hand over scans. `duty`: of the motor, if it can be told."""
        now_s = time.monotonic()
        watchdog = TurnWatchdog(self._url, now_s)
        self._speed = None if duty is None else SpeedRegulator(self._lidar.rate_hz, duty, now_s)
        stream = self._begin_stream(line, mode)
        began_s, told_s, heard_s, data = now_s, -math.inf, now_s, rest
        while not stop.is_set():
            now_s = time.monotonic()
            if data:
                heard_s = now_s
            for scan in stream.feed(data, now_s):
                if self._scan is None:
                    begin()
                self._scan = scan
                self._put(scan)
                told_s = now_s if self._hold_speed(line, stream, now_s) else told_s
            try:
                watchdog.look(
                    now_s,
                    heard=bool(data),
                    points=self.counts.points,
                    turns=stream.turns,
                    swept_rad=stream.swept_rad,
                )
            except DeviceError:
                self._judge(mode, stream, heard=heard_s > began_s)
                raise
            if now_s - heard_s > ENDED_S and now_s - told_s < BLAME_S:
                told_s, data = -math.inf, unit.begin(mode) or b""
            else:
                data = line.read(READ_S)

    def _begin_stream(self, line: Line, mode: Mode) -> Stream:
        settings = self._settings
        decoder = self._decoders[mode.answer](mode.sample_s)
        cutter = TurnCutter(Mounting(settings.yaw_offset_rad, settings.mirror), decoder.back_rad)
        self._scan = None
        self._stream = Stream(
            decoder,
            mode.sample_s,
            line.byte_s,
            cutter,
            self._lidar,
            self.counts,
            ascending_time=settings.ascending_time,
        )
        return self._stream

    def _hold_speed(self, line: Line, stream: Stream, now_s: float) -> bool:
        """Trim the motor; returns whether it was told anything."""
        duty = None if self._speed is None else self._speed.turned(stream.rate_hz, now_s)
        if duty is not None:
            with contextlib.suppress(DeviceError):  # it scans: a line that is lost is noticed where it is read
                line.write(protocol.encode_motor(duty))
        return duty is not None

    def _judge(self, mode: Mode, stream: Stream, *, heard: bool) -> None:
        """A stream of which not a point was understood is not tried again, as long as there is another."""
        if heard and stream.swept_rad == 0.0 and stream.turns == 0 and mode.answer is not Answer.STANDARD:
            self._unread.add(mode.answer)
        else:
            self._unread.clear()

    def diagnostics(self) -> DiagnosticStatus:
        """Who the unit is, how it is, how it scans and what was lost."""
        values = [("device", self._url)]
        info, mode, stream, speed, scan = self.info, self.mode, self._stream, self._speed, self._scan
        complaints = []
        if info is not None:
            values += [("model", f"{info.model:#04x}"), ("firmware", "{}.{:02}".format(*info.firmware))]
            values += [("hardware", str(info.hardware)), ("serial", info.serial), ("baud", str(self.baud))]
        if self.health is not None:
            status, code = self.health
            values.append(("health", f"{status.name.lower()}, {code:#06x}"))
            if status is Health.WARNING:
                complaints.append(f"the unit warns of {code:#06x}")
        if mode is not None:
            values.append(("mode", f"{mode.name} ({mode.answer:#04x})".strip()))
            values.append(("samples/s by mode", f"{1.0 / mode.sample_s:.0f}"))
        if stream is not None and stream.newest is not None:
            rate_hz, turn = stream.rate_hz, stream.newest
            values.append(("samples/s", f"{len(turn.time_s) * rate_hz:.0f}"))
            values.append(("rate Hz", f"{rate_hz:.2f}"))
            values.append(("samples without a return", f"{np.mean(turn.distance_m == 0.0):.0%}"))
        if speed is not None:
            values.append(("motor duty", str(speed.duty)))
            if speed.off and stream is not None:
                complaints.append(f"the head turns at {stream.rate_hz:.1f} Hz instead of {speed.wanted_hz:.1f}")
        if scan is not None:
            values.append(("beams that say nothing", f"{np.mean(np.isnan(scan.ranges)):.0%}"))
        counts = self.counts
        values += [("turns", str(counts.turns)), ("turns dropped", str(counts.dropped_turns))]
        values.append(("bytes lost", str(counts.lost_bytes)))
        return DiagnosticStatus(WARN if complaints else OK, "lidar", "; ".join(complaints) or "ok", tuple(values))
