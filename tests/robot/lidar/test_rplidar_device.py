import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lira.hal.profile import load_profile
from lira.robot.rplidar import protocol
from lira.robot.rplidar.device import RPLidar
from lira.robot.settings import LidarSettings
from lira.robot.supervisor import Supervisor
from lira.sim_backend.emulators.rplidar import RplidarUnit, descriptor
from lira.sim_backend.emulators.rplidar_models import (
    DENSE_MODE,
    EXPRESS_MODE,
    MODELS,
    STANDARD_MODE,
    ULTRA_DENSE_MODE,
    ULTRA_MODE,
    Model,
)
from lira.sim_backend.emulators.rplidar_streams import seal
from lira.sim_backend.emulators.wire import Wire

pytestmark = pytest.mark.slow

LIDAR = load_profile("rosbot2").lidar
SETTINGS = LidarSettings(spin_up_s=0.0)
LAST_WORDS_S = 1.0  # that a driver is done says not that all is through the wire


def room(theta_rad):
    """A wall 1 m ahead and 2 m to the left of the robot; nothing elsewhere."""
    bearing = -theta_rad
    ahead, left = np.cos(bearing), np.sin(bearing)
    ahead_m = np.where(ahead > 0.5, 1.0 / np.maximum(ahead, 0.5), 0.0)
    return np.where(left > 0.9, 2.0 / np.maximum(left, 0.9), ahead_m)


class Bench:
    """A unit on a wire, and its driver."""

    def __init__(self, path, model=None, settings=SETTINGS):
        self.unit = RplidarUnit(room, model)
        self.wire = Wire(path, self.unit)
        self.scans = []
        self.driver = RPLidar(str(path), LIDAR, settings, self.scans.append)
        self.supervisor = Supervisor("lidar", self.driver.session, self.driver.rest)

    def __enter__(self):
        self.supervisor.start()
        return self

    def __exit__(self, *_):
        self.supervisor.close()
        until_s = time.monotonic() + LAST_WORDS_S
        while (self.unit.scanning or self.unit.pwm) and time.monotonic() < until_s:
            time.sleep(0.01)
        self.wire.close()

    def wait_scans(self, count, timeout_s=20.0):
        until_s, count = time.monotonic() + timeout_s, len(self.scans) + count
        while len(self.scans) < count:
            assert time.monotonic() < until_s, self.supervisor.failure
            time.sleep(0.01)
        return self.scans[-1]


def at(scan, degrees):
    return scan.ranges[round((math.radians(degrees) - scan.angle_min) / scan.angle_increment) % len(scan.ranges)]


def around(scan, degrees, within=3):
    return np.nanmedian([at(scan, degrees + offset) for offset in range(-within, within + 1)])


DENSE = replace(DENSE_MODE, sample_s=100e-6)
UNITS = {
    "express, old firmware": (Model(firmware=(1, 20)), "EXPRESS"),
    "standard, oldest firmware": (Model(firmware=(1, 10), modes=(STANDARD_MODE,)), "STANDARD"),
    "express by table": (Model(), "EXPRESS"),
    "dense": (Model(baud=256000, modes=(STANDARD_MODE, EXPRESS_MODE, DENSE)), "DENSE"),
    "ultra dense": (Model(baud=256000, modes=(STANDARD_MODE, EXPRESS_MODE, ULTRA_DENSE_MODE)), "ULTRA_DENSE"),
    "ultra": (Model(modes=(STANDARD_MODE, EXPRESS_MODE, ULTRA_MODE)), "ULTRA"),
    "ultra, fast": (Model(baud=256000, modes=(STANDARD_MODE, replace(ULTRA_MODE, sample_s=63e-6))), "ULTRA"),
    "standard only": (Model(modes=(STANDARD_MODE,)), "STANDARD"),
    "256000 baud": (Model(baud=256000), "EXPRESS"),
}


@pytest.mark.parametrize("name", UNITS)
def test_it_scans_at_the_right_speed_in_the_best_mode(tmp_path, name):
    model, mode = UNITS[name]
    with Bench(tmp_path / "lidar", model) as bench:
        scan = bench.wait_scans(5)
        assert bench.driver.mode.answer.name == mode
        assert bench.driver.info.firmware == model.firmware
        assert around(scan, 0) == pytest.approx(1.0, abs=0.02)
        assert around(scan, 90) == pytest.approx(2.0, abs=0.03)
        assert around(scan, 40) == pytest.approx(1.0 / math.cos(math.radians(40)), abs=0.05)
        assert np.isnan([at(scan, degrees) for degrees in (180, -120, 140)]).all()
        assert np.median([each.scan_time for each in bench.scans]) == pytest.approx(0.1, abs=0.02)
        assert np.median([each.time_increment for each in bench.scans]) < 0.0
        assert 0.0 <= time.monotonic() - scan.stamp_s < 0.5
        assert bench.driver.counts.lost_bytes == 0
    assert not bench.unit.scanning
    assert bench.unit.pwm == 0


def test_the_mounting_turns_and_mirrors(tmp_path):
    with Bench(tmp_path / "turned", settings=LidarSettings(spin_up_s=0.0, yaw_offset_deg=180.0)) as bench:
        scan = bench.wait_scans(1)
        assert around(scan, 180) == pytest.approx(1.0, abs=0.02)
        assert around(scan, -90) == pytest.approx(2.0, abs=0.03)
    with Bench(tmp_path / "mirrored", settings=LidarSettings(spin_up_s=0.0, mirror=True)) as bench:
        scan = bench.wait_scans(1)
        assert around(scan, 0) == pytest.approx(1.0, abs=0.02)
        assert around(scan, -90) == pytest.approx(2.0, abs=0.03)
        assert scan.time_increment > 0.0


def test_a_left_over_stream_does_not_disturb_the_start(tmp_path):
    bench = Bench(tmp_path / "lidar")
    bench.unit.receive(protocol.encode_motor(660) + protocol.encode_request(0x20), time.monotonic())
    time.sleep(0.1)
    with bench:
        assert around(bench.wait_scans(1), 0) == pytest.approx(1.0, abs=0.02)


def test_an_error_is_reset_once(tmp_path):
    bench = Bench(tmp_path / "lidar")
    bench.unit.failed = True
    with bench:
        bench.wait_scans(1, 8.0)


def test_a_broken_unit_is_refused_with_its_code(tmp_path, failure_of):
    bench = Bench(tmp_path / "lidar", Model(broken=True))
    refused = failure_of(bench.supervisor)
    bench.wire.close()
    assert "reports error 0x8008" in refused.what
    assert "turn freely" in refused.remedy


def test_a_unit_at_no_speed_of_an_rplidar_is_refused(tmp_path, failure_of):
    bench = Bench(tmp_path / "lidar", Model(baud=9600))
    bench.unit.begin(STANDARD_MODE, 660, time.monotonic())  # it streams, so something is heard
    assert "is no RPLIDAR" in failure_of(bench.supervisor).what
    bench.wire.close()


def test_garbage_and_loss_are_survived_and_counted(tmp_path):
    with Bench(tmp_path / "lidar") as bench:
        bench.wait_scans(1)
        bench.wire.disturb(300)
        bench.wait_scans(2)
        bench.wire.loss = 0.002
        bench.wait_scans(5)
        assert bench.driver.counts.lost_bytes >= 300
        assert np.nanmedian([at(scan, 0) for scan in bench.scans[-5:]]) == pytest.approx(1.0, abs=0.02)
        assert bench.supervisor.alive


def test_unplugged_it_says_so_and_comes_back_by_itself(tmp_path):
    with Bench(tmp_path / "lidar") as bench:
        bench.wait_scans(1)
        bench.wire.unplug()
        until_s = time.monotonic() + 1.0
        while bench.supervisor.alive:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        bench.unit.mode = None
        bench.wire.plug()
        bench.wait_scans(1, 6.0)
        assert bench.supervisor.alive
        assert bench.supervisor.sessions == 2


def test_a_unit_that_falls_silent_is_lost(tmp_path):
    with Bench(tmp_path / "lidar") as bench:
        bench.wait_scans(1)
        bench.unit.mode = None
        until_s = time.monotonic() + 2.0
        while bench.supervisor.alive:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        assert "fell silent" in str(bench.supervisor.failure)


def test_a_motor_that_needs_longer_than_its_time_is_waited_for(tmp_path):
    with Bench(tmp_path / "lidar", Model(spin_up_s=3.0)) as bench:
        bench.wait_scans(1, 9.0)
        assert (bench.supervisor.sessions, bench.supervisor.failure) == (1, None)


def test_a_unit_that_ends_its_scan_when_its_motor_is_told_goes_on(tmp_path):
    with Bench(tmp_path / "lidar", Model(hz_at_660=11.5, pwm_ends_scan=True)) as bench:
        until_s = time.monotonic() + 15.0
        while bench.unit.pwm in (0, 660):
            assert time.monotonic() < until_s, bench.supervisor.failure
            time.sleep(0.01)
        bench.wait_scans(5)
        assert bench.supervisor.losses == 0
        assert bench.driver.diagnostics().values


def test_noise_is_no_scan_and_the_head_turns_on_meanwhile(tmp_path):
    with Bench(tmp_path / "lidar") as bench:
        bench.wait_scans(1)
        sound = bench.unit.emit
        bench.unit.emit = lambda now_s: bytes(len(sound(now_s)))
        until_s = time.monotonic() + 8.0
        while bench.supervisor.alive:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        assert "sends nothing that is a scan" in str(bench.supervisor.failure)
        assert bench.unit.pwm > 0
        bench.unit.emit = sound
        bench.wait_scans(1, 12.0)
        bench.unit.emit = lambda now_s: bytes(len(sound(now_s)))
        while bench.supervisor.alive:
            time.sleep(0.01)
        bench.unit.emit = sound
    assert bench.unit.pwm == 0  # closed between two tries


def test_a_warning_and_what_it_does_is_told(tmp_path):
    with Bench(tmp_path / "lidar", replace(MODELS["a2m8-1.29"], warning=0x0042, spin_up_s=0.0)) as bench:
        until_s, rate = time.monotonic() + 20.0, math.nan
        while rate != pytest.approx(7874, rel=0.1):  # on a busy machine they come in bursts
            assert time.monotonic() < until_s, rate
            bench.wait_scans(3)
            told = bench.driver.diagnostics()
            values = dict(told.values)
            rate = float(values["samples/s"])
    assert told.level == 1
    assert "0x0042" in told.message
    assert values["firmware"] == "1.29"
    assert values["mode"] == "Sensitivity (0x84)"
    assert values["bytes lost"] == "0"


def test_what_is_missing_or_no_lidar_is_named(tmp_path, failure_of):
    def failure(path):
        return failure_of(Supervisor("lidar", RPLidar(str(path), LIDAR, SETTINGS, lambda _: None).session))

    assert "there is no" in failure(tmp_path / "nothing").what
    (tmp_path / "file").write_text("")
    assert "does not open" in failure(tmp_path / "file").what

    class Mute:
        baud = 115200

        def receive(self, data, now_s):
            pass

        def emit(self, now_s):
            return b""

    wire = Wire(tmp_path / "mute", Mute())
    assert "no lidar answers" in failure(tmp_path / "mute").what
    wire.close()


SCAN_FOR_EVER = """
import sys, threading
from lira.hal.profile import load_profile
from lira.hal.signals import stop_on_signal
from lira.robot.rplidar.device import RPLidar
from lira.robot.settings import LidarSettings
with stop_on_signal() as stop:
    driver = RPLidar(sys.argv[1], load_profile("rosbot2").lidar, LidarSettings(spin_up_s=0.0), lambda scan: None)
    driver.session(stop, lambda: print("scans", flush=True))
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_the_motor_stops_on_sigterm_and_a_killed_program_does_not_spoil_the_next_start(tmp_path, number):
    bench = Bench(tmp_path / "lidar", replace(Model(), modes=(STANDARD_MODE, EXPRESS_MODE)))
    child = subprocess.Popen([sys.executable, "-c", SCAN_FOR_EVER, str(tmp_path / "lidar")], stdout=subprocess.PIPE)
    assert child.stdout.readline() == b"scans\n"
    os.kill(child.pid, number)
    child.wait(10.0)
    child.stdout.close()
    until_s, goes_on = time.monotonic() + 10.0, number == signal.SIGKILL
    while (bench.unit.scanning, bench.unit.pwm > 0) != (goes_on, goes_on):  # its last words are still on the wire
        assert time.monotonic() < until_s
        time.sleep(0.01)
    with bench:
        assert around(bench.wait_scans(1), 0) == pytest.approx(1.0, abs=0.02)


@pytest.fixture(scope="module", params=["EXPRESS", "ULTRA", "DENSE", "ULTRA_DENSE", "STANDARD"])
def scanning(request, tmp_path_factory):
    modes = {
        "EXPRESS": EXPRESS_MODE,
        "ULTRA": ULTRA_MODE,
        "DENSE": DENSE,
        "ULTRA_DENSE": ULTRA_DENSE_MODE,
        "STANDARD": STANDARD_MODE,
    }
    model = Model(baud=256000, modes=(STANDARD_MODE, modes[request.param]))
    with pytest.MonkeyPatch.context() as patch, Bench(tmp_path_factory.mktemp("wire") / "lidar", model) as bench:
        patch.setattr("lira.robot.rplidar.speed.SILENCE_S", 5.0)  # a busy machine is silent, too; here bytes are tried
        bench.wait_scans(1)
        yield bench


CAPSULES = st.builds(
    lambda start, body, begins: seal(start, body, begins=begins),
    st.floats(0.0, math.tau),
    st.binary(min_size=80, max_size=80),
    st.booleans(),
)
HEADS = st.builds(descriptor, st.integers(0, 2**30 - 1), st.integers(0, 255))


@settings(max_examples=8, deadline=None)
@given(st.lists(st.binary(max_size=200) | CAPSULES | HEADS, max_size=8).map(b"".join))
def test_whatever_comes_over_its_line_it_scans_on(scanning, odd):
    scanning.wire.inject(odd)
    scanning.wait_scans(3, 10.0)
    assert scanning.supervisor.losses == 0, scanning.supervisor._failure
