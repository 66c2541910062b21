import math
import re
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lira.hal.messages import STOP, Odometry, Twist
from lira.robot.core2.device import Core2
from lira.robot.settings import BaseSettings
from lira.robot.supervisor import Supervisor
from lira.sim_backend.emulators.core2 import Core2Unit, Firmware
from lira.sim_backend.emulators.rosserial import encode, topic_info
from lira.sim_backend.emulators.wire import Wire

FAST = Firmware(boot_s=0.1)
SETTINGS = BaseSettings(boot_s=0.15, spin_slip_m_rad=0.0)


class Bench:
    """A board on a wire with wheels that obey at once, and its driver."""

    def __init__(self, path, firmware=FAST, timeout_s=0.3):
        self.twists = [STOP]
        self.yaw_rad = 0.5
        self.unit = Core2Unit(self.drive, self.measure, firmware)
        self.wire = Wire(path, self.unit)
        self.base = Core2(str(path), SETTINGS, timeout_s)
        self.supervisor = Supervisor("base", self.base.session)

    def drive(self, twist):
        if twist != self.twists[-1]:
            self.twists.append(twist)

    def measure(self):
        twist = self.twists[-1]
        return Odometry(0.0, 1.0, 2.0, self.yaw_rad, twist.linear_m_s, twist.angular_rad_s)

    def __enter__(self):
        self.supervisor.start()
        self.supervisor.wait_alive(5.0)
        return self

    def __exit__(self, *_):
        self.supervisor.close()
        time.sleep(0.03)
        self.wire.close()

    def get_going(self, twist):
        """Command until the wheels have it; a busy machine takes its time."""
        until_s = time.monotonic() + 20.0
        while self.twists[-1] != twist:
            assert time.monotonic() < until_s, self.twists
            self.keep(twist, 0.1)

    def keep(self, twist, seconds):
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.base.drive(twist)
            time.sleep(0.02)


def wait_for(condition, timeout_s=10.0):
    until_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < until_s
        time.sleep(0.01)


def test_the_age_of_a_command_counts_from_when_it_was_decided(tmp_path):
    with Bench(tmp_path / "base", timeout_s=2.0) as bench:
        began_s = time.monotonic()
        bench.base.drive(Twist(0.1, 0.0), began_s - 1.5)
        wait_for(lambda: bench.twists[-2:] == [Twist(0.1, 0.0), STOP])
        assert time.monotonic() - began_s < 1.9
        bench.base.drive(Twist(0.1, 0.0), time.monotonic() - 2.5)
        time.sleep(0.2)
        assert bench.twists[-1] == STOP
        assert len(bench.twists) == 3


def test_a_driver_that_hung_on_its_lock_sends_nothing_that_is_old_by_then(tmp_path):
    with Bench(tmp_path / "base") as bench:
        bench.get_going(Twist(0.1, 0.0))
        with bench.base._lock:
            wait_for(lambda: bench.twists[-1] == STOP)  # the guard strikes
            time.sleep(0.3)
            seen = len(bench.twists)
        time.sleep(0.3)
        assert bench.twists[seen:] == []


@pytest.mark.parametrize("baud", [525000, 500000, 460800])
def test_it_finds_the_speed_and_learns_the_topics(tmp_path, baud):
    with Bench(tmp_path / "base", Firmware(baud=baud, boot_s=0.1)) as bench:
        assert bench.base.baud == baud
        wait_for(lambda: bench.base.readings.battery is not None and bench.base.readings.imu is not None)
        wait_for(lambda: bench.unit.watchdog)
        assert bench.unit.motors
        assert not bench.unit.crashed


def test_a_board_at_no_speed_of_a_core2_is_refused(tmp_path, failure_of):
    bench = Bench(tmp_path / "base", Firmware(baud=9600, boot_s=0.0))
    bench.unit.receive(bytes.fromhex("fffe0000ff0000ff"), time.monotonic())  # it publishes, so something is heard
    assert "is no CORE2" in failure_of(bench.supervisor).what
    bench.wire.close()
    assert not bench.unit.crashed


def all_of_it_moves(readings):
    """Each topic comes at its own rate."""
    odom, imu = readings.odom, readings.imu
    moves = odom is not None and imu is not None and odom.linear_m_s > 0.0 and imu.lateral_m_s2 > 0.0
    return moves and readings.battery is not None and len(readings.ranges) == 4


def test_it_drives_reads_and_stands_when_closed(tmp_path):
    with Bench(tmp_path / "base") as bench:
        bench.get_going(Twist(0.2, 0.5))
        wait_for(lambda: all_of_it_moves(bench.base.readings))
        readings, now_s = bench.base.readings, time.monotonic()
        assert readings.odom.linear_m_s == pytest.approx(0.2)
        assert readings.odom.angular_rad_s == pytest.approx(0.5)
        assert -0.001 <= now_s - readings.odom.stamp_s < 0.2
        assert readings.imu.yaw_rad == pytest.approx(0.5)
        assert readings.imu.lateral_m_s2 == pytest.approx(0.1)
        assert readings.battery.voltage_v == pytest.approx(11.7)
        assert sorted(readings.ranges) == ["range_fl", "range_fr", "range_rl", "range_rr"]
        assert all(math.isnan(reading.range_m) for reading in readings.ranges.values())
    assert bench.twists[-1] == STOP
    assert not bench.unit.crashed


def test_a_program_that_no_longer_commands_stands(tmp_path):
    with Bench(tmp_path / "base") as bench:
        bench.keep(Twist(0.2, 0.0), 0.2)
        silent_s = time.monotonic()
        wait_for(lambda: bench.twists[-1] == STOP)
        assert time.monotonic() - silent_s < 0.6
        sent = bench.base.counts.commands
        wait_for(lambda: bench.base.counts.commands - sent >= 8)  # zeros go on


def test_commands_go_out_at_once_and_only_the_newest(tmp_path):
    with Bench(tmp_path / "base") as bench:
        for i in range(100):
            bench.base.drive(Twist(0.001 * i, 0.0))
        wait_for(lambda: bench.twists[-1] == Twist(0.099, 0.0), 0.25)
        assert len(bench.twists) < 10


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite_never_leaves(tmp_path, bad):
    base = Core2("nowhere", SETTINGS, 0.3)
    with pytest.raises(ValueError, match="no velocity"):
        base.drive(Twist(bad, 0.0))


def test_motors_are_cut_and_given_back(tmp_path):
    with Bench(tmp_path / "base") as bench:
        bench.base.cut_motors(True)
        wait_for(lambda: not bench.unit.motors)
        bench.keep(Twist(0.2, 0.0), 0.2)
        assert bench.twists[-1] == STOP
        bench.base.cut_motors(False)
        wait_for(lambda: bench.unit.motors)


def test_time_is_answered_so_that_the_board_stays(tmp_path, monkeypatch):
    monkeypatch.setattr("lira.sim_backend.emulators.core2.ASK_TIME_S", 0.1)
    monkeypatch.setattr("lira.sim_backend.emulators.core2.GIVE_UP_S", 1.5)
    with Bench(tmp_path / "base") as bench:
        time.sleep(2.0)
        assert bench.unit.configured
        assert bench.base.answers
        assert bench.base.counts.negotiations == 1


def test_after_a_reset_of_the_board_it_negotiates_anew(tmp_path):
    with Bench(tmp_path / "base") as bench:
        bench.keep(Twist(0.2, 0.0), 0.2)
        bench.unit.firmware = Firmware(boot_s=1.3)
        bench.unit.reset()
        wait_for(lambda: not bench.base.answers)
        assert bench.twists[-1] == STOP
        wait_for(lambda: bench.base.answers, 4.0)
        wait_for(lambda: bench.unit.watchdog)
        assert bench.base.counts.negotiations == 2
        assert bench.supervisor.sessions == 1
        assert not bench.unit.crashed


def test_no_farewell_goes_to_a_board_that_has_announced_nothing_since_it_was_lost(tmp_path):
    with Bench(tmp_path / "base") as bench:
        bench.keep(Twist(0.2, 0.0), 0.2)
        bench.wire.mute = True
        bench.unit.reset(0.1)
        bench.keep(Twist(0.2, 0.0), 0.7)
        zeros = bench.unit.obeyed_unannounced
        assert zeros  # the ones that a silent board gets
        bench.supervisor.close()
        time.sleep(0.1)
        assert bench.unit.obeyed_unannounced == zeros
        assert bench.twists[-1] == STOP


def test_what_is_at_the_line_when_it_is_opened_again_gets_requests_only(tmp_path, monkeypatch):
    monkeypatch.setattr("lira.robot.core2.device.FRAME_S", 0.1)
    monkeypatch.setattr("lira.robot.core2.device.BAUDS", (525000,))
    with Bench(tmp_path / "base") as bench:
        bench.keep(Twist(0.2, 0.0), 0.2)
        bench.wire.unplug()
        bench.unit.reset(0.0)
        bench.wire.mute = True
        bench.wire.plug()
        wait_for(lambda: "no base board answers" in str(bench.supervisor.failure), 8.0)
        time.sleep(0.1)
        assert bench.unit.commanded_s == -math.inf


def test_garbage_is_counted_and_survived(tmp_path):
    with Bench(tmp_path / "base") as bench:
        bench.wire.disturb(400)
        bench.wire.loss = 0.01
        wait_for(lambda: bench.base.counts.lost_bytes >= 400)
        bench.get_going(Twist(0.1, 0.0))


def test_unplugged_it_says_so_and_comes_back(tmp_path):
    with Bench(tmp_path / "base") as bench:
        bench.wire.unplug()
        wait_for(lambda: not bench.supervisor.alive)
        assert "was lost" in str(bench.supervisor.failure) or "there is no" in str(bench.supervisor.failure)
        bench.unit.reset()
        bench.wire.plug()
        wait_for(lambda: bench.supervisor.alive, 6.0)


def test_another_layout_of_a_topic_is_named(tmp_path, failure_of):
    bench = Bench(tmp_path / "base", Firmware(boot_s=0.1, md5s=(("cmd_vel", "0" * 32),)))
    assert re.search(r"cmd_vel.*unknown layout", failure_of(bench.supervisor).what)
    bench.wire.close()
    assert not bench.unit.crashed


def test_an_id_that_was_never_announced_crashes_the_emulated_board():
    unit = Core2Unit(print, lambda: None, FAST)
    unit.receive(b"", 0.0)
    unit.receive(bytes.fromhex("fffe0000ffc80037"), 1.0)
    assert unit.crashed


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    with Bench(tmp_path_factory.mktemp("wire") / "base") as bench:
        yield bench


FRAMES = st.builds(encode, st.integers(0, 200), st.binary(max_size=600))
ANNOUNCEMENTS = st.builds(
    lambda way, number, name, md5: encode(way, topic_info(number, name, "kind", md5)),
    st.integers(0, 3),
    st.integers(0, 200),
    st.sampled_from(["pose", "imu", "battery", "range/fl", "buttons", "else"]),
    st.sampled_from(["", "0" * 32, "9f195f881246fdfa2798d1d3eebca84a"]),
)


@settings(max_examples=12, deadline=None)
@given(st.lists(st.binary(max_size=200) | FRAMES | ANNOUNCEMENTS, max_size=6).map(b"".join))
def test_whatever_comes_over_its_line_it_measures_on(running, odd):
    running.wire.inject(odd)
    time.sleep(0.05)
    now_s = time.monotonic()
    wait_for(lambda: running.base.answers and running.base.readings.odom.stamp_s > now_s, 10.0)
    assert running.supervisor.losses == 0
    assert not running.unit.crashed
