"""A recording as a robot: what was measured is measured again, at its time and with its stamps."""

import pytest
from samples import BEGAN_NS, OFFSET_NS, battery, drive, odom, write

from lira.hal.errors import DeviceError
from lira.hal.messages import Command, Episode, Reason, Source, Twist
from lira.tools.recording.reader import Recording
from lira.tools.recording.recorded_robot import RecordedRobot

BEGAN_S = (BEGAN_NS - OFFSET_NS) / 1e9


@pytest.fixture
def recording(tmp_path):
    """Two seconds: odometry each 0.05 s, scan and picture each 0.1 s, a battery at the beginning."""
    write(tmp_path / "rec", drive(2), aligned=True)
    return Recording(tmp_path / "rec")


def test_every_sensor_is_the_newest_that_was_recorded_by_then(recording):
    robot = RecordedRobot(recording)
    assert robot.now() == BEGAN_S
    robot.wait(BEGAN_S + 0.01)
    first = robot.read()
    assert first.odom.x_m == 0.0
    assert first.battery is not None
    assert first.image.format == "png"
    assert first.scan.stamp_s == pytest.approx(4.98)
    robot.wait(BEGAN_S + 0.21)
    assert robot.read().odom.x_m == 4.0
    assert robot.read().scan.stamp_s == pytest.approx(5.18)
    assert robot.read().seq > first.seq


def test_time_passes_in_wait_alone_and_never_back(recording):
    robot = RecordedRobot(recording)
    seen = robot.read()
    assert robot.read() is seen
    robot.wait(BEGAN_S - 3.0)
    assert robot.now() == BEGAN_S
    robot.wait(BEGAN_S + 1.5)
    assert robot.now() == BEGAN_S + 1.5


def test_with_a_clock_time_passes_by_itself_and_as_fast_as_it_is_told(recording):
    now, slept = [100.0], []
    robot = RecordedRobot(recording, lambda: now[0], slept.append, speed=2.0)
    now[0] = 100.5
    assert robot.now() == BEGAN_S + 1.0
    robot.wait(BEGAN_S + 2.0)
    assert slept == [0.5]


def test_it_takes_commands_and_goes_its_way(recording):
    robot = RecordedRobot(recording)
    applied = robot.drive(Command(Twist(0.5, 0.1), BEGAN_S - 0.1, Source.POLICY, 7))
    assert (applied.twist, applied.reason, applied.answers) == (Twist(0.5, 0.1), Reason.OK, 7)
    assert applied.command_age_s == pytest.approx(0.1)


def test_after_the_end_all_is_stale_but_what_lasts_and_a_reset_begins_it_again(recording):
    robot = RecordedRobot(recording)
    robot.wait(BEGAN_S + 2.5)
    over = robot.read()
    assert robot.ended
    assert (over.scan, over.odom, over.image) == (None, None, None)
    robot.reset(Episode())
    assert not robot.ended
    robot.wait(robot.now() + 0.01)
    again = robot.read()
    assert again.odom.x_m == 0.0
    assert again.odom.stamp_s == pytest.approx(4.99 + 2.5)  # its clock goes on
    assert again.seq > over.seq


def test_who_recorded_no_truth_has_none(tmp_path):
    write(tmp_path / "rec", [battery(5.0), odom(0, 5.0)])
    with pytest.raises(DeviceError, match="truly"):
        RecordedRobot(Recording(tmp_path / "rec")).state()
