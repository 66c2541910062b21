import re
import time

from fresh import lira

from lira.hal.bus.bus import Bus
from lira.hal.client.connect import open_remote
from lira.hal.messages import STOP, Command, Reason, Twist
from lira.hal.profile import load_profile
from lira.sim_backend.emulators.core2 import Firmware
from lira.sim_backend.emulators.wired_twin import WiredTwin
from lira.sim_backend.twin import Twin
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

GO = Twist(0.3, 0.0)
NOT_ON_THE_ROBOT = ["torch", "pybullet", "pygame", "safetensors", "matplotlib"]


def test_help_needs_nothing_heavy():
    done = lira("robot", "--help", block=[*NOT_ON_THE_ROBOT, "serial", "openni", "zenoh", "cv2"])
    assert done.returncode == 0, done.stderr
    assert "--lidar" in done.stdout


def test_it_is_not_driven_blind_unless_told():
    done = lira("robot", "--base", "nowhere", "--camera", "openni:")
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "lira robot: no --lidar",
        "  Give its URL, or say --without lidar to drive without it.",
    ]
    done = lira("robot", "--base", "nowhere", "--camera", "openni:", "--without", "camera", "--without", "lidar")
    assert "both --camera and --without camera" in done.stderr


def test_a_missing_device_is_named_with_its_remedy(tmp_path):
    words = ["--base", str(tmp_path / "base"), "--without", "lidar", "--without", "camera"]
    words += ["--listen", f"127.0.0.1:{free_port()}", "--name", f"r{free_port()}"]
    done = lira("robot", *words, block=NOT_ON_THE_ROBOT)
    assert done.returncode == 2, done.stderr
    assert f"there is no {tmp_path / 'base'}" in done.stderr
    assert "/dev/serial/by-id" in done.stderr


def test_without_pyserial_it_says_what_to_install(tmp_path):
    done = lira("robot", "--base", "x", "--without", "lidar", "--without", "camera", block=["serial"])
    assert done.returncode == 2
    assert "lira-rosbot[robot]" in done.stderr


def test_the_twin_behind_its_devices_is_driven_over_the_bus(tmp_path):
    port = free_port()
    name, endpoint, folder = f"wire_{port}", f"127.0.0.1:{port}", tmp_path / "wire"
    with ChildProcess("the devices", lira_command("twin", "--wire", str(folder)), tmp_path / "twin.log") as twin:
        line = twin.wait_ready("open them with: lira robot", 60.0)
        words = re.search(r"lira robot (.*)", line)[1].split()
        command = lira_command("robot", *words, "--name", name, "--listen", endpoint)
        with ChildProcess("the robot", command, tmp_path / "lira.robot.log") as server:
            server.wait_ready("serves", 60.0)
            bus = Bus(name, connect=endpoint)
            robot = open_remote(bus)
            seen, moved = set(), False
            until_s = time.monotonic() + 15.0
            while not (moved and seen >= {"scan", "image", "odom", "imu"}) and time.monotonic() < until_s:
                observation = robot.read()
                seen |= {part for part in ("scan", "image", "odom", "imu") if getattr(observation, part) is not None}
                armed = robot.drive(Command(STOP, robot.now(), answers=observation.seq)).reason is Reason.OK
                twist = Twist(0.3, 0.0) if armed else STOP
                robot.drive(Command(twist, robot.now(), answers=observation.seq))
                robot.wait(robot.now() + 0.2)
                moved |= observation.odom is not None and observation.odom.x_m > 0.05
            robot.close()
            assert bus.close()
            assert (moved, seen) == (True, {"scan", "image", "odom", "imu"})
            assert server.stop() == 0
    assert not list(folder.iterdir())


def test_the_lidars_plug_pulled_mid_drive_stops_it_within_half_a_second_and_it_resumes_when_rearmed(tmp_path):
    port = free_port()
    name, endpoint, folder = f"plug_{port}", f"127.0.0.1:{port}", tmp_path / "wire"
    (tmp_path / "quick.toml").write_text("[lidar]\nspin_up_s = 0.0\n[base]\nboot_s = 0.2\n")
    wired = WiredTwin(
        Twin(load_profile("thesis-sim"), "line", realtime_factor=1.0), folder, firmware=Firmware(boot_s=0.1)
    )
    words = ["--lidar", str(folder / "rplidar"), "--base", str(folder / "core2"), "--camera", wired.url]
    words += ["--settings", str(tmp_path / "quick.toml"), "--profile", "thesis-sim"]
    command = lira_command("robot", *words, "--name", name, "--listen", endpoint)
    try:
        with ChildProcess("the robot", command, tmp_path / "lira.robot.log") as server:
            server.wait_ready("serves", 60.0)
            bus = Bus(name, connect=endpoint)
            robot = open_remote(bus)
            drive(robot, STOP, lambda applied: applied.reason is Reason.OK)
            drive(robot, GO, lambda _: wired.state().linear_m_s > 0.1)
            wired.lidar_wire.unplug()
            pulled_s = time.monotonic()
            drive(robot, GO, lambda _: wired.state().linear_m_s == 0.0)
            assert time.monotonic() - pulled_s < 0.5
            assert drive(robot, GO, lambda applied: "no_lidar" in applied.clamps).reason is Reason.STALE
            server.wait_ready("the robot stands: ", 2.0)
            wired.lidar_wire.plug()
            drive(robot, GO, lambda applied: applied.reason is Reason.NEUTRAL_FIRST, 15.0)
            server.wait_ready("the lidar is back; the robot moves again after a zero command", 2.0)
            assert wired.state().linear_m_s == 0.0
            drive(robot, STOP, lambda applied: applied.reason is Reason.OK)
            drive(robot, GO, lambda _: wired.state().linear_m_s > 0.1)
            robot.close()
            assert bus.close()
            assert server.stop() == 0
    finally:
        wired.close()


def drive(robot, twist, wanted, timeout_s=5.0):
    """Command until what is wanted happens; returns the last of what was applied."""
    until_s = time.monotonic() + timeout_s
    while not wanted(applied := robot.drive(Command(twist, robot.now()))):
        assert time.monotonic() < until_s, applied
        time.sleep(0.01)
    return applied
