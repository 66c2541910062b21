import json
import os
import re
import subprocess
import sys
import threading
import time
from collections import namedtuple

import cv2
import pytest
from pad_bed import SONY, Bed, library

from lira.hal.bus.bus import Bus
from lira.hal.errors import DeviceError
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.testing import NullRobot
from lira.robot.camera.sources.stream_clock import LATE_S
from lira.tools.cli import main
from lira.tools.doctor import access, machine
from lira.tools.doctor.checks import CHECKS, Check, examine, worst
from lira.tools.doctor.finding import Finding, Level, Patient, fail, ok, warn
from lira.tools.doctor.sensors import _battery, _rate
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

PATIENT = Patient(load_profile("rosbot2"))
MACHINE = [check for check in CHECKS if not check.wanted]
LOOKS = 4
ROOM = ("--profile", "rosbot2", "--world", "room", "--renderer", "sketch")


def test_this_machine_is_looked_at_and_nothing_about_it_breaks_a_check():
    found = list(examine(PATIENT))
    assert {name for name, _ in found} == {check.name for check in MACHINE}
    for name, finding in found:
        assert "check itself failed" not in finding.what, (name, finding)
        assert finding.remedy or finding.level is Level.OK, (name, finding)


def test_the_status_says_whether_something_failed():
    done = subprocess.run(lira_command("doctor", "--json", "-"), check=False, capture_output=True, timeout=60)
    status, answer = done.returncode, json.loads(done.stdout)
    assert status == (1 if answer["failed"] else 0)
    assert (answer["level"] == "failed") == bool(answer["failed"])
    assert {row["check"] for row in answer["checks"]} == {check.name for check in MACHINE}


def test_every_row_names_a_function_that_takes_a_patient():
    from lira.tools.doctor.checks import _load

    assert len({check.name for check in CHECKS}) == len(CHECKS)
    assert all(callable(_load(check.place)) for check in CHECKS)
    assert all(check.wanted in Patient.__dataclass_fields__ for check in CHECKS if check.wanted)


def refuses(_):
    raise DeviceError("it is off", "Switch it on.")


def breaks(_):
    return 1 / 0


def lacks(_):
    raise ModuleNotFoundError("No module named 'serial'", name="serial")


@pytest.mark.parametrize(
    ("function", "what", "remedy"),
    [
        ("refuses", "it is off", "Switch it on."),
        ("breaks", "the check itself failed: ZeroDivisionError: division by zero", "Report this line."),
        ("lacks", "serial is not installed", "Install it with: pip install 'lira-rosbot[robot]'"),
    ],
)
def test_a_check_that_fails_says_so_and_ends_no_other(function, what, remedy):
    checks = [Check("first", f"{__name__}:{function}"), Check("second", "lira.tools.doctor.machine:python")]
    first, second = [finding for _, finding in examine(PATIENT, checks)]
    assert (first.level, first.what, first.remedy) == (Level.FAILED, what, remedy)
    assert second.level is Level.OK


def test_the_worst_of_all_counts():
    assert worst([]) is Level.OK
    assert worst([ok("a"), warn("b", "c"), ok("d")]) is Level.WARNING
    assert worst([warn("b", "c"), fail("e", "f"), ok("d")]) is Level.FAILED


def test_an_old_python_a_small_processor_and_a_full_disk_are_named(monkeypatch):
    Usage = namedtuple("Usage", "free")
    monkeypatch.setattr(machine.sys, "version_info", (3, 10, 1))
    assert machine.python(PATIENT).level is Level.FAILED
    monkeypatch.setattr(machine.sys, "version_info", (3, 15, 0))
    assert machine.python(PATIENT).level is Level.WARNING
    for free, level in ((1e8, Level.FAILED), (1e9, Level.WARNING), (1e10, Level.OK)):
        monkeypatch.setattr(machine.shutil, "disk_usage", lambda _, free=free: Usage(free))
        assert machine.disk(PATIENT).level is level
    monkeypatch.setattr(machine.platform, "machine", lambda: "riscv64")
    assert machine.processor(PATIENT).level is Level.WARNING
    monkeypatch.setattr(machine.platform, "machine", lambda: "armv7l")
    monkeypatch.setattr(machine.ctypes, "sizeof", lambda _: 4)
    found = machine.processor(PATIENT)
    assert found.level is Level.FAILED
    assert "serve its serial ports" in found.remedy


def test_a_base_package_that_is_missing_fails_and_a_part_that_is_missing_does_not(monkeypatch):
    monkeypatch.setattr(machine, "_has", lambda name: name not in ("zenoh", "serial"))
    first, second = machine.packages(PATIENT)
    assert (first.level, first.what) == (Level.FAILED, "not installed: zenoh")
    assert second.level is Level.OK
    assert "robot" in second.values["lacking"]


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux")
def test_the_kernels_clock_is_read():
    error, unset, away_s = machine._kernel_clock()
    assert isinstance(error, bool)
    assert isinstance(unset, bool)
    assert 0.0 <= away_s < 1e6


def test_keys_that_are_wrong_fail_with_their_remedy(tmp_path, monkeypatch):
    monkeypatch.setenv("LIRA_KEYS", str(tmp_path))
    ((_, found),) = [(name, finding) for name, finding in examine(PATIENT) if name == "keys"]
    assert found.level is Level.FAILED
    assert "lira keys init" in found.remedy
    monkeypatch.delenv("LIRA_KEYS")
    assert access.keys(PATIENT).level is Level.OK


def test_batteries_and_rates_are_judged():
    assert [_battery(volts).level for volts in (12.1, 10.5, 9.0, None, float("nan"))] == [
        Level.OK, Level.WARNING, Level.FAILED, Level.WARNING, Level.WARNING,
    ]  # fmt: skip
    stamps_s = [k * 0.1 for k in range(20)]
    assert _rate("scans", stamps_s, 10.0, [0.1] * 20).level is Level.OK
    assert _rate("scans", stamps_s, 20.0, [0.1] * 20).level is Level.WARNING
    assert _rate("scans", stamps_s, 10.0, [2 * LATE_S] * 20).level is Level.WARNING
    assert _rate("scans", [1.0], 10.0, [0.1]).level is Level.FAILED


def diagnose(path, *words):
    """Run the doctor; its status, and what it found of each check."""
    status = main(["doctor", *words, "--json", str(path)])
    found = {}
    for row in json.loads(path.read_text())["checks"]:
        found.setdefault(row["check"], []).append(row)
    return status, found


def test_devices_are_looked_at_live_and_a_picture_is_kept(tmp_path):
    folder, picture = tmp_path / "wire", tmp_path / "seen.jpg"
    command = lira_command("twin", "--wire", str(folder), *ROOM)
    with ChildProcess("the devices", command, tmp_path / "twin.log") as twin:
        line = twin.wait_ready("open them with: lira robot", 60.0)
        words = re.search(r"lira robot (.*)", line)[1].split()
        for _ in range(LOOKS):  # a busy machine's devices are late: then they are looked at again
            status, found = diagnose(tmp_path / "found.json", *words, "--out", str(picture), "--seconds", "2")
            if status == 0:
                break
    assert status == 0, found
    assert "RPLIDAR" in found["lidar"][0]["what"]
    assert found["lidar"][1]["values"]["rate_hz"] > 3.0
    assert 0.0 <= found["lidar"][2]["values"]["empty"] <= 1.0
    assert "CORE2" in found["base"][0]["what"]
    assert [row["values"]["voltage"] for row in found["base"] if "voltage" in row["values"]]
    assert found["camera"][1]["values"]["age_s"] < LATE_S
    assert cv2.imread(str(picture)).shape == (480, 640, 3)


def test_devices_that_are_not_there_fail_each_with_its_remedy_and_without_the_password(tmp_path, capfd):
    camera = f"http://me:hunter2@127.0.0.1:{free_port()}/?pw=hunter3"
    status, found = diagnose(
        tmp_path / "found.json", "--lidar", "/dev/nothing", "--base", "/dev/nothing2", "--camera", camera
    )
    assert status == 1
    assert all(found[name][0]["level"] == "failed" for name in ("lidar", "base", "camera"))
    assert all(found[name][0]["remedy"] for name in ("lidar", "base", "camera"))
    assert "hunter" not in json.dumps(found) + "".join(capfd.readouterr())


def test_the_way_to_a_robot_is_measured(tmp_path):
    name, endpoint = f"doctor{os.getpid()}", f"127.0.0.1:{free_port()}"
    bus = Bus(name, listen=endpoint)
    stop, ready = threading.Event(), threading.Event()
    robot = GovernedRobot(NullRobot(PATIENT.profile, time.monotonic, time.sleep))
    server = threading.Thread(target=HalServer(robot, bus, ready=ready.set).run, args=[stop])
    server.start()
    try:
        assert ready.wait(10.0)
        words = ["--name", name, "--connect", endpoint, "--seconds", "1"]
        rows = diagnose(tmp_path / "found.json", *words)[1]["robot"]
    finally:
        stop.set()
        server.join(10.0)
        bus.close()
    assert "profile rosbot2" in rows[0]["what"]
    assert 0.0 < rows[1]["values"]["round_trip_s"] < 1.0
    assert rows[2]["values"]["links"] == 2


@pytest.mark.skipif(library() is None, reason="needs libumockdev (Debian package umockdev)")
@pytest.mark.parametrize(("rest", "level"), [(128, "ok"), (142, "warning"), (150, "failed")])
def test_the_pad_is_looked_at(tmp_path, rest, level):
    bed = Bed(tmp_path)
    try:
        bed.plug(4, f"{SONY} Motion Sensors", motion=True)
        bed.plug(5)
        bed.axis(5, "ABS_Y", rest)
        command = [*bed.environment, *lira_command("doctor", "--pad", "--seconds", "1")]
        with ChildProcess("the doctor", command, tmp_path / "doctor.log") as process:
            assert process.wait(60.0) == (1 if level == "failed" else 0), process.output()
    finally:
        bed.close()
    lines = [line for line in process.output().splitlines() if " pad: " in line]
    assert f"ok       pad: {SONY} (/dev/input/event5), layout PS3; its controls: dead-man BTN_TL" in lines[0]
    assert lines[1].startswith(level)
    assert "reports a second" in lines[2]


def test_a_finding_is_a_line():
    assert Finding(Level.OK, "x").remedy == ""
