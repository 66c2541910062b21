"""Clients that nobody here wrote, the vendor's own among them, on the emulated units. Each is skipped without it."""

import itertools
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from lira.sim_backend.emulators.rplidar_models import MODELS

SPEED = 600 / 660  # of what a unit does at 660: the clients' duty of the motor
CLOSE_S = 0.2


def room(theta_rad):
    """Walls of a room of 4 x 3 m, the unit in its middle."""
    along, across = np.abs(np.cos(theta_rad)), np.abs(np.sin(theta_rad))
    return np.minimum(2.0 / np.maximum(along, 1e-6), 1.5 / np.maximum(across, 1e-6))


# In a process of its own: a client that is no Python may keep the interpreter to itself while it waits.
SERVE = """
import sys
from pathlib import Path
from lira.sim_backend.emulators.rplidar import RplidarUnit
from lira.sim_backend.emulators.rplidar_models import MODELS
from lira.sim_backend.emulators.wire import Wire
from test_rplidar_clients import room
wire = Wire(Path(sys.argv[1]), RplidarUnit(room, MODELS[sys.argv[2]]))
print("ready", flush=True)
sys.stdin.read()
wire.close()
"""


@pytest.fixture(params=MODELS)
def line(request):
    """A unit at the end of a line: its model and the line's path, which has to be short for the vendor's client."""
    here, folder = str(Path(__file__).parent), tempfile.mkdtemp()
    path = f"{folder}/lidar"
    command = [sys.executable, "-c", SERVE, path, request.param]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, env={**os.environ, "PYTHONPATH": here}, **pipes) as child:
        assert child.stdout.readline() == "ready\n"
        yield MODELS[request.param], path
        time.sleep(CLOSE_S)
    shutil.rmtree(folder)


@pytest.fixture(autouse=True)
def no_modem_lines(monkeypatch):
    """A pseudo-terminal has none; some clients set one to start an A1's motor."""
    serial = pytest.importorskip("serial", reason="no client of others is installed")
    monkeypatch.setattr(serial.Serial, "_update_dtr_state", lambda _: None)


def sees_the_room(theta_rad, distance_m):
    """Whether points lie on the walls, but for those without a return."""
    here = distance_m > 0.0
    off_m = np.abs(distance_m[here] - room(theta_rad[here]))
    return np.mean(here) > 0.85 and np.median(off_m) < 0.005


def connected(sdk, path, model):
    """A client that is connected. Its time-outs are short for a machine that has other work."""
    for _ in range(5):
        driver = sdk.RplidarDriver(port=path, baudrate=model.baud)
        if driver.connect():
            return driver
    raise AssertionError("the client does not connect")


def test_the_vendors_client_scans_and_finds_a_unit_that_a_killed_one_left_scanning(line):
    sdk = pytest.importorskip("pyrplidarsdk", reason="no client of others is installed")
    model, path = line
    driver = connected(sdk, path, model)
    assert driver.get_device_info().model == model.number
    assert driver.get_health().status == 0
    assert driver.start_scan()
    time.sleep(model.spin_up_s + 1.0)
    points = model.modes[model.typical].sample_s ** -1 / (model.hz_at_660 * (SPEED if model.has_pwm else 1.0))
    scan = next(scan for scan in iter(driver.get_scan_data, 0) if scan is not None)
    angle, distance = (np.array(values) for values in scan[:2])
    theta = angle if angle.max() < math.tau + 0.1 else np.radians(angle)
    assert len(theta) == pytest.approx(points, rel=0.08)
    assert sees_the_room(theta, distance if distance.max() < 50.0 else distance / 1000.0)
    again = connected(sdk, path, model)  # the first one still scans
    again.disconnect()
    driver.disconnect()


def test_a_second_client_sees_whole_turns(line):
    rplidar = pytest.importorskip("rplidar", reason="no client of others is installed")
    model, path = line
    lidar = rplidar.RPLidar(path, baudrate=model.baud)
    lidar.motor_speed = 600
    try:
        assert lidar.get_info()["model"] == model.number
        assert lidar.get_health()[0] == "Good"
        _, scan = itertools.islice(lidar.iter_scans(), 2)
    finally:
        lidar.stop()
        lidar.stop_motor()
        lidar.disconnect()
    _, degrees, millimetres = (np.array(values) for values in zip(*scan, strict=True))
    mode = model.modes[0]
    rate_hz = model.hz_at_660 * (SPEED if model.has_pwm else 1.0)
    assert len(scan) == pytest.approx(1.0 / mode.sample_s / rate_hz, rel=0.12)
    assert sees_the_room(np.radians(degrees), millimetres / 1000.0)


def test_a_third_client_reads_the_table_of_modes_and_one_start_a_turn(line):
    pyrplidar = pytest.importorskip("pyrplidar", reason="no client of others is installed")
    model, path = line
    lidar = pyrplidar.PyRPlidar()
    lidar.connect(port=path, baudrate=model.baud, timeout=3)
    try:
        if model.firmware >= (1, 24):
            names = [mode.name for mode in lidar.get_scan_modes()]
            assert [name.strip("\0") for name in names] == [mode.name for mode in model.modes]
            assert lidar.get_scan_mode_typical() == model.typical
        lidar.set_motor_pwm(600)
        time.sleep(2.0 * model.spin_up_s)
        seen = list(itertools.islice(lidar.force_scan()(), 1500))
        assert sum(node.start_flag for node in seen[-1000:]) == pytest.approx(1000 * _turns(model), abs=1.1)
        lidar.stop()
    finally:
        lidar.set_motor_pwm(0)
        lidar.disconnect()


def _turns(model):
    """Turns of the head a sample in standard mode."""
    return model.modes[0].sample_s * model.hz_at_660 * (SPEED if model.has_pwm else 1.0)
