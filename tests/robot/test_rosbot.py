import math
import time
from contextlib import contextmanager
from itertools import pairwise

import msgspec
import pytest

from lira.hal.errors import ConfigError, DeviceError
from lira.hal.messages import STOP, Command, Reason, Twist
from lira.hal.profile import Depth, load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.robot.rosbot import Devices, Rosbot
from lira.robot.settings import BaseSettings, LidarSettings, Settings, load_settings
from lira.sim_backend.emulators.camera import MjpegServer
from lira.sim_backend.emulators.core2 import Firmware
from lira.sim_backend.emulators.wired_twin import WiredTwin
from lira.sim_backend.twin import Twin

PROFILE = load_profile("thesis-sim")
QUICK = Settings(lidar=LidarSettings(spin_up_s=0.0), base=BaseSettings(boot_s=0.1))
GO = Twist(0.3, 0.0)


@contextmanager
def wired(folder, firmware=Firmware(boot_s=0.05)):  # noqa: B008 - frozen
    bench = WiredTwin(Twin(PROFILE, "line", realtime_factor=1.0), folder, firmware=firmware)
    try:
        yield bench
    finally:
        bench.close()


@contextmanager
def opened(bench, folder):
    robot = Rosbot(PROFILE, Devices(str(folder / "core2"), str(folder / "rplidar"), bench.url, settings=QUICK))
    robot.open()
    try:
        yield Governed(robot)
    finally:
        robot.close()


class Governed(GovernedRobot):
    """A governed robot that still says what is wrong with it."""

    def __init__(self, robot):
        super().__init__(robot)
        self.troubles = robot.troubles


def keep(robot, twist, seconds, until=lambda _: False):
    """Command for a while as the HAL server does; returns the last of what was applied."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        applied = robot.drive(Command(twist, robot.now()))
        if until(applied):
            break
        robot.wait(robot.now() + 0.02)
    return applied


def drives(applied):
    return applied.twist == GO


def get_going(robot, seconds=0.3):
    """Drive for so long, after a neutral command; where a busy machine lets it stop meanwhile, after another one."""
    for _ in range(10):
        keep(robot, STOP, 0.1)
        keep(robot, GO, 1.0, drives)
        if keep(robot, GO, seconds).twist == GO:
            return
    raise AssertionError("it does not get going")


def drives_through(robot, fault):
    """Whether it goes on driving through a fault. Where a busy machine makes this hand pause, it begins again."""
    for _ in range(10):
        get_going(robot)
        fault()
        at_s = []
        drove = drives(keep(robot, GO, 0.6, lambda _, at_s=at_s: at_s.append(time.monotonic())))
        if drove or max(after - before for before, after in pairwise(at_s)) < PROFILE.control.robot_timeout_s / 2:
            return drove
    raise AssertionError("this hand paused each time")


def stops_for(robot, clamp, seconds):
    """Command on until it stands for this reason; whether it did. A busy machine may stop it for another one first."""
    return clamp in keep(robot, GO, seconds, lambda applied: clamp in applied.clamps).clamps


def waits(applied):
    return applied.reason is Reason.NEUTRAL_FIRST


def test_it_drives_the_twin_through_the_wires_and_sees_what_the_twin_sees(tmp_path):
    with wired(tmp_path) as bench, opened(bench, tmp_path) as robot:
        get_going(robot, 0.8)
        seen, truth, direct = robot.read(), bench.twin.state(), bench.twin.read()
        assert seen.odom.linear_m_s == pytest.approx(0.3)
        assert seen.odom.x_m == pytest.approx(truth.x_m, abs=0.1)
        assert seen.image is not None
        assert seen.imu is not None
        assert seen.battery.voltage_v > 11.0
        assert len(seen.ranges) == 4
        assert seen.scan.ranges.shape == direct.scan.ranges.shape
        keep(robot, STOP, 0.1)
        robot.close()
        with pytest.raises(DeviceError):
            robot.read()
        assert not bench.lidar.scanning
        assert bench.lidar.pwm == 0
        assert not bench.base.crashed


@pytest.mark.parametrize("device", ["lidar", "base"])
def test_unplugged_mid_drive_it_stands_and_resumes_after_return_and_a_neutral_command(tmp_path, device):
    with wired(tmp_path) as bench, opened(bench, tmp_path) as robot:
        get_going(robot)
        wire = getattr(bench, f"{device}_wire")
        wire.unplug()
        unplugged_s = time.monotonic()
        assert stops_for(robot, f"no_{device}", 1.0)
        assert time.monotonic() - unplugged_s < 0.5
        assert device in robot.troubles()
        keep(robot, GO, 0.2)
        if device == "lidar":  # a base without its cable goes on until its firmware's watchdog
            assert bench.twin.state().linear_m_s == 0.0
        wire.plug()
        applied = keep(robot, GO, 8.0, waits)
        assert (applied.reason, applied.twist) == (Reason.NEUTRAL_FIRST, STOP)
        keep(robot, GO, 0.2)
        assert bench.twin.state().linear_m_s == 0.0
        get_going(robot)
        assert robot.troubles() == {}


def test_a_camera_that_goes_mid_drive_stops_it_and_it_resumes_after_its_return_and_a_neutral_command(tmp_path):
    with wired(tmp_path) as bench, opened(bench, tmp_path) as robot:
        get_going(robot)
        bench.camera.close()
        gone_s = time.monotonic()
        assert stops_for(robot, "no_camera", 3.0)
        assert time.monotonic() - gone_s < 0.5
        assert "camera" in robot.troubles()
        keep(robot, GO, 0.2)
        assert bench.twin.state().linear_m_s == 0.0
        bench.camera = MjpegServer(bench.camera.port)
        assert keep(robot, GO, 8.0, waits).twist == STOP
        get_going(robot)


def test_a_lidar_that_fails_mid_drive_stops_it_is_reset_and_it_resumes_after_a_neutral_command(tmp_path):
    with wired(tmp_path) as bench, opened(bench, tmp_path) as robot:
        get_going(robot)
        bench.lidar.failed, bench.lidar.mode = True, None  # its motor is stuck: it stops and reports an error
        failed_s = time.monotonic()
        assert stops_for(robot, "no_lidar", 3.0)
        assert time.monotonic() - failed_s < 0.8  # the last scan may be 0.5 s old
        assert keep(robot, GO, 10.0, waits).twist == STOP
        assert not bench.lidar.failed
        get_going(robot)


def test_a_reset_of_the_board_stops_it_until_the_board_is_back(tmp_path):
    with wired(tmp_path) as bench, opened(bench, tmp_path) as robot:
        get_going(robot)
        bench.base.firmware = Firmware(boot_s=1.2)
        bench.base.reset()
        assert stops_for(robot, "no_base", 2.0)
        assert keep(robot, GO, 5.0, waits).twist == STOP
        keep(robot, GO, 0.2)
        assert bench.twin.state().linear_m_s == 0.0
        assert not bench.base.crashed


def test_a_dead_program_leaves_the_wheels_to_the_boards_watchdog(tmp_path):
    with wired(tmp_path) as bench, opened(bench, tmp_path) as robot:
        get_going(robot)
        assert bench.twin.state().linear_m_s > 0.0
        bench.base_wire.unplug()
        time.sleep(1.3)
        assert bench.twin.state().linear_m_s == 0.0


def test_without_commands_the_base_stands_by_itself(tmp_path):
    with wired(tmp_path) as bench, opened(bench, tmp_path) as robot:
        get_going(robot)
        time.sleep(PROFILE.control.robot_timeout_s + 0.25)
        assert bench.twin.state().linear_m_s == 0.0


def test_garbage_on_both_lines_does_not_stop_it(tmp_path):
    with wired(tmp_path) as bench, opened(bench, tmp_path) as robot:
        assert drives_through(robot, lambda: [wire.disturb(200) for wire in (bench.lidar_wire, bench.base_wire)])
        assert not bench.base.crashed


def test_what_is_missing_is_named_and_the_rest_let_go(tmp_path):
    with wired(tmp_path) as bench:
        robot = Rosbot(PROFILE, Devices(str(tmp_path / "core2"), str(tmp_path / "nothing"), bench.url, settings=QUICK))
        with pytest.raises(DeviceError, match=r"there is no .*nothing"):
            robot.open()
        with opened(bench, tmp_path):
            pass


def test_lidar_and_base_swapped_are_told_apart(tmp_path):
    with wired(tmp_path) as bench:
        swapped = Devices(str(tmp_path / "rplidar"), str(tmp_path / "core2"), bench.url, settings=QUICK)
        robot = Rosbot(PROFILE, swapped)
        with pytest.raises(DeviceError, match=r"no base board answers|is no CORE2|no lidar answers|is no RPLIDAR"):
            robot.open()
        assert not bench.base.crashed


def test_a_profile_with_depth_needs_a_camera_that_has_it(tmp_path):
    deep = msgspec.structs.replace(PROFILE, depth=Depth(width_px=16, height_px=12, range_min_m=0.1, range_max_m=4.0))
    with wired(tmp_path) as bench:
        devices = Devices(str(tmp_path / "core2"), str(tmp_path / "rplidar"), bench.url, settings=QUICK)
        with pytest.raises(ConfigError, match=r"has no depth.*profile"):
            Rosbot(deep, devices).open()


def test_nothing_not_finite_reaches_the_base(tmp_path):
    robot = Rosbot(PROFILE, Devices("nowhere"))
    applied = robot.drive(Command(Twist(math.nan, 0.0), 0.0))
    assert applied.twist == STOP


def test_settings_are_read_and_mistakes_named(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("[lidar]\nyaw_offset_deg = 180\nmirror = true\n[base]\nturn_scale = 1.12\n")
    settings = load_settings(path)
    assert settings.lidar.yaw_offset_rad == pytest.approx(math.pi)
    assert settings.base.turn_scale == 1.12
    path.write_text("[lidar]\nyaw = 180\n")
    with pytest.raises(ConfigError, match="yaw"):
        load_settings(path)
