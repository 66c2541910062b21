import os
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import pytest

from lira.hal.errors import DeviceError
from lira.hal.messages import STOP, Odometry
from lira.hal.profile import load_profile
from lira.robot.core2.device import Core2
from lira.robot.rplidar.device import RPLidar
from lira.robot.serial_port import Line
from lira.robot.settings import BaseSettings, LidarSettings
from lira.robot.supervisor import Supervisor
from lira.sim_backend.emulators.core2 import Core2Unit, Firmware
from lira.sim_backend.emulators.rplidar import RplidarUnit
from lira.sim_backend.emulators.wire import Wire


@contextmanager
def serial_server(unit):
    """A unit behind a TCP port, as a serial server puts it there; yields its URL and a way to hang up."""
    stop, hang_up = threading.Event(), threading.Event()
    listener = socket.create_server(("127.0.0.1", 0))
    listener.settimeout(0.05)

    def serve():
        while not stop.is_set():
            try:
                connection, _ = listener.accept()
            except TimeoutError:
                continue
            hang_up.clear()
            with connection:
                connection.settimeout(0.002)
                while not (stop.is_set() or hang_up.is_set()):
                    try:
                        data = connection.recv(4096)
                        if not data:
                            break
                        unit.receive(data, time.monotonic())
                    except TimeoutError:
                        pass
                    try:
                        connection.sendall(unit.emit(time.monotonic()))
                    except OSError:
                        break

    thread = threading.Thread(target=serve)
    thread.start()
    yield f"socket://127.0.0.1:{listener.getsockname()[1]}", hang_up
    stop.set()
    thread.join()
    listener.close()


def wait_for(condition, timeout_s=5.0):
    until_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < until_s
        time.sleep(0.01)


def test_a_port_that_another_program_reads_is_in_use(tmp_path):
    ours, theirs = os.openpty()
    path = os.ttyname(theirs)
    reads = f"import os, time; os.open({path!r}, os.O_RDWR | os.O_NOCTTY); print('open', flush=True); time.sleep(60)"
    child = subprocess.Popen([sys.executable, "-c", reads], stdout=subprocess.PIPE)
    try:
        assert child.stdout.readline() == b"open\n"
        with pytest.raises(DeviceError, match=rf"in use by .*\({child.pid}\)"):
            Line(path, 115200)
    finally:
        child.kill()
        child.wait()
        child.stdout.close()
    Line(path, 115200).close()
    os.close(ours)
    os.close(theirs)


def test_lidar_and_base_work_behind_serial_servers_and_come_back_after_a_hang_up():
    scans = []
    lidar_unit = RplidarUnit(lambda theta: 1.0 + 0.0 * theta)
    odom = Odometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    base_unit = Core2Unit(lambda _: None, lambda: odom, Firmware(boot_s=0.0))
    with serial_server(lidar_unit) as (lidar_url, hang_up), serial_server(base_unit) as (base_url, _):
        lidar = RPLidar(lidar_url, load_profile("rosbot2").lidar, LidarSettings(spin_up_s=0.0), scans.append)
        base = Core2(base_url, BaseSettings(boot_s=0.0), 0.3)
        supervisors = [Supervisor("lidar", lidar.session), Supervisor("base", base.session)]
        for supervisor in supervisors:
            supervisor.start()
        for supervisor in supervisors:
            supervisor.wait_alive(5.0)
        wait_for(lambda: len(scans) >= 2)
        hang_up.set()
        wait_for(lambda: not supervisors[0].alive)
        wait_for(lambda: supervisors[0].alive)
        assert base.readings.odom is not None
        base.drive(STOP)
        for supervisor in supervisors:
            supervisor.close()


def test_nobody_there_is_said_with_the_address():
    with pytest.raises(DeviceError, match=r"127\.0\.0\.1:1 does not open"):
        Line("socket://127.0.0.1:1", 115200)


def test_a_port_serves_one_program(tmp_path):
    wire = Wire(tmp_path / "port", RplidarUnit(lambda theta: theta))
    line = Line(str(tmp_path / "port"), 115200)
    with pytest.raises(DeviceError, match="in use by another program"):
        Line(str(tmp_path / "port"), 115200)
    line.close()
    Line(str(tmp_path / "port"), 115200).close()
    wire.close()


def test_a_read_comes_back_in_time(tmp_path):
    wire = Wire(tmp_path / "port", RplidarUnit(lambda theta: theta))
    line = Line(str(tmp_path / "port"), 115200)
    began_s = time.monotonic()
    assert line.read(0.05) == b""
    assert 0.04 < time.monotonic() - began_s < 1.0
    wire.unplug()
    with pytest.raises(DeviceError, match="was lost"):
        line.read(0.05)
    line.close()
    wire.close()
