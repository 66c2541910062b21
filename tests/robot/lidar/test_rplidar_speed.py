"""The head: its speed held and watched, with emulated units in a time of their own."""

import math

import numpy as np
import pytest
from msgspec.structs import replace

from lira.hal.errors import DeviceError
from lira.hal.profile import load_profile
from lira.robot.rplidar import protocol
from lira.robot.rplidar.decoders import DECODERS
from lira.robot.rplidar.protocol import Answer
from lira.robot.rplidar.speed import TRIES, SpeedRegulator, TurnWatchdog
from lira.robot.rplidar.stream import Counts, Stream
from lira.robot.rplidar.turn import Mounting, TurnCutter
from lira.sim_backend.emulators.rplidar import RplidarUnit
from lira.sim_backend.emulators.rplidar_models import MODELS

LIDAR = load_profile("rosbot2").lidar
PIECE_S = 0.004
DESCRIPTOR = 7


def room(theta_rad):
    """Walls of a room of 4 x 3 m, the unit in its middle."""
    along, across = np.abs(np.cos(theta_rad)), np.abs(np.sin(theta_rad))
    return np.minimum(2.0 / np.maximum(along, 1e-6), 1.5 / np.maximum(across, 1e-6))


def scan_with(model, rate_hz, seconds=8.0):
    """What the driver makes of a unit that it holds at a speed: the scans of the last second, and the stream."""
    unit, mode = RplidarUnit(room, model), model.modes[model.typical]
    decoder = DECODERS[Answer(mode.answer)](mode.sample_s)
    cutter = TurnCutter(Mounting(), decoder.back_rad)
    lidar, counts = replace(LIDAR, rate_hz=rate_hz), Counts()
    stream = Stream(decoder, mode.sample_s, 10 / model.baud, cutter, lidar, counts)
    speed = SpeedRegulator(rate_hz, 660, 0.0)
    unit.receive(protocol.encode_motor(660), 0.0)
    unit.receive(protocol.encode_express(model.typical), 0.0)
    assert len(unit.emit(0.01)) == DESCRIPTOR
    kept = []
    for tick in range(3, round(seconds / PIECE_S)):
        now_s = tick * PIECE_S
        for scan in stream.feed(unit.emit(now_s), now_s):
            duty = speed.turned(stream.rate_hz, now_s)
            if duty is not None:
                unit.receive(protocol.encode_motor(duty), now_s)
            if now_s > seconds - 1.0:
                kept.append(scan)
    assert counts.lost_bytes == 0
    return kept, stream


@pytest.mark.parametrize("rate_hz", [10.0, 11.0, 12.0])
def test_an_a2m8_fills_every_beam_at_the_speed_of_the_profile(rate_hz):
    scans, stream = scan_with(MODELS["a2m8-1.29"], rate_hz)
    assert stream.rate_hz == pytest.approx(rate_hz, rel=0.03)
    assert len(scans) >= rate_hz - 2
    for scan in scans:
        assert np.count_nonzero(np.isfinite(scan.ranges)) == 400
        bearing = scan.angle_min + scan.angle_increment * np.arange(400)
        assert np.percentile(np.abs(scan.ranges - room(-bearing)), 95) < 0.03


@pytest.mark.parametrize("name", MODELS)
def test_every_unit_sees_the_room(name):
    scans, _ = scan_with(MODELS[name], 10.0, 4.0)
    assert len(scans) >= 6
    for scan in scans:
        bearing = scan.angle_min + scan.angle_increment * np.arange(400)
        off_m = np.abs(scan.ranges - room(-bearing))
        assert np.count_nonzero(np.isfinite(off_m)) >= 396
        assert np.nanmedian(off_m) < 0.008
        assert scan.scan_time == pytest.approx(1.0 / (7.3 if name == "a1" else 10.0), rel=0.08)


def test_a_motor_that_does_not_listen_is_left_alone():
    speed, told = SpeedRegulator(10.0, 660, 0.0), []
    for tick in range(300):
        duty = speed.turned(7.0, tick * 0.14)
        told += [] if duty is None else [duty]
    assert len(told) <= TRIES
    assert max(told) <= 1023
    assert speed.off


def test_a_head_that_is_fast_enough_is_not_touched_and_a_speed_that_no_unit_has_is_not_wanted():
    speed = SpeedRegulator(10.0, 660, 0.0)
    assert [speed.turned(10.1, tick * 0.1) for tick in range(100)] == [None] * 100
    assert speed.turned(math.nan, 20.0) is None
    assert SpeedRegulator(100.0, 660, 0.0).wanted_hz == 15.0


def look(watchdog, now_s, **told):
    watchdog.look(now_s, **{"heard": True, "points": 0, "turns": 0, "swept_rad": 0.0} | told)


def look_on(watchdog, times_s, **told):
    for now_s in times_s:
        look(watchdog, now_s, **told)


def test_a_head_may_take_ten_seconds_to_begin():
    watchdog = TurnWatchdog("lidar", 0.0)
    for tick in range(99):
        look(watchdog, tick * 0.1, heard=False)
    with pytest.raises(DeviceError, match="has not begun to scan within 10 s") as lost:
        look(watchdog, 10.1, heard=False)
    assert "motor" in lost.value.remedy


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"heard": False, "points": 400}, "fell silent"),
        ({"points": 400}, "sends nothing that is a scan"),
        ({"points": 700, "swept_rad": 1.3 * math.pi}, "turns at 0.6 Hz only"),
    ],
)
def test_bytes_without_turns_are_a_loss_and_why_is_said(told, words):
    watchdog = TurnWatchdog("lidar", 0.0)
    look(watchdog, 0.1, points=400, turns=1)
    look(watchdog, 0.5, points=650 if "swept_rad" in told else 400, turns=1, heard=told.get("heard", True))
    with pytest.raises(DeviceError, match=words):
        look_on(watchdog, (0.9, 1.15), turns=1, **told)


def test_a_watchdog_that_stood_still_itself_accuses_nobody():
    watchdog = TurnWatchdog("lidar", 0.0)
    look(watchdog, 0.1, points=400, turns=1)
    look(watchdog, 5.0, points=400, turns=1, heard=False)
    look(watchdog, 5.4, points=400, turns=1)
