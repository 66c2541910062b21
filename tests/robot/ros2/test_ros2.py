"""A robot that runs ROS 2 behind a bridge is driven and read with nothing of ours on it."""

import math
import re
import threading
import time
from contextlib import closing

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from ros2_peer import ATTACHMENTS, Peer, twist_cdr
from ros2_rig import GO, PROFILE, drive_until, get_going, served, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.errors import BusError, ConfigError, DeviceError
from lira.hal.messages import STOP, Command, CompressedImage, LaserScan, Reason
from lira.hal.messages.ros.types import definition
from lira.robot.ros2.forms import placed_scan, plain_picture
from lira.robot.ros2.robot import Interface, Ros2Robot
from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

STAMPED = "geometry_msgs/msg/TwistStamped"
ZERO = bytes(48)  # six doubles


@pytest.mark.parametrize("attach", ATTACHMENTS)
@pytest.mark.parametrize("rmw", [False, True])
def test_its_sensors_are_seen_whatever_is_attached_and_a_twist_reaches_it_as_ros_has_it(attach, rmw):
    with served(namespace="robot1", attach=attach, rmw=rmw) as (robot, client):
        get_going(client)
        wait_for(lambda: robot.commands[-1][1] == twist_cdr(0.3, 0.5))
        wait_for(lambda: None not in ((seen := client.read()).scan, seen.image, seen.odom))
        seen = client.read()
        assert len(seen.scan.ranges) == 360
        assert isinstance(seen.image, CompressedImage)
        assert seen.image.format == "jpeg"
        assert (seen.odom.x_m, seen.odom.linear_m_s) == (1.5, 0.25)
        for sensor in (seen.scan, seen.image, seen.odom):
            assert abs(robot.now_ns() / 1e9 - sensor.stamp_s) < 0.4
        assert abs(client.now() - robot.now_ns() / 1e9) < 0.2
    assert robot.commands[-1][1] == twist_cdr(0.0, 0.0)


@pytest.mark.parametrize("far", [{}, {"rmw": True, "stamped": True}])
def test_a_controller_that_wants_stamps_gets_them_on_its_own_clock(far):
    with served(Interface(stamped=True), **far) as (robot, client):
        get_going(client)
        schema = Schema(1, data=definition(STAMPED).encode(), encoding="ros2msg", name=STAMPED)
        decode = DecoderFactory().decoder_for("cdr", schema)
        wait_for(lambda: robot.commands and decode(robot.commands[-1][1]).twist.linear.x == 0.3)
        came_ns, payload = robot.commands[-1]
        message = decode(payload)
        assert message.twist.angular.z == 0.5
        assert message.header.frame_id == "base_link"
        age_s = came_ns / 1e9 - (message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)
        assert -0.01 < age_s < 0.2


@pytest.mark.parametrize("rmw", [False, True])
@pytest.mark.parametrize(("topic", "clamp"), [("scan", "no_lidar"), ("camera/color/image_raw/compressed", "no_camera")])
def test_what_falls_silent_stops_it_until_it_is_back_and_a_neutral_command_came(topic, clamp, rmw):
    with served(rmw=rmw) as (robot, client):
        get_going(client)
        robot.silent.add(topic)
        silent_s = time.monotonic()
        drive_until(client, GO, lambda applied: clamp in applied.clamps)
        wait_for(lambda: robot.commands[-1][1] == twist_cdr(0.0, 0.0), 0.5)
        assert time.monotonic() - silent_s < 1.0
        robot.silent.clear()
        drive_until(client, GO, lambda applied: applied.reason is Reason.NEUTRAL_FIRST)
        assert robot.commands[-1][1] == twist_cdr(0.0, 0.0)
        get_going(client)


@pytest.mark.parametrize("rmw", [False, True])
def test_commands_go_on_at_20_hz_and_end_when_the_client_does(rmw):
    with served(rmw=rmw) as (robot, client):
        get_going(client)
        before = len(robot.commands)
        until_s = time.monotonic() + 1.0
        while time.monotonic() < until_s:
            client.drive(Command(GO, client.now()))
            time.sleep(0.02)
        assert 8 <= len(robot.commands) - before <= 60  # a busy machine is late with some
        wait_for(lambda: robot.commands[-1][1] == twist_cdr(0.0, 0.0), 1.5)  # a decision is kept alive for 0.5 s


def test_what_was_decided_too_long_ago_by_the_time_it_is_sent_is_zero():
    with closing(Peer(port := free_port())), closing(Bus("far", connect=f"127.0.0.1:{port}", prefix="")) as bus:
        robot = Ros2Robot(PROFILE, bus, Interface())
        robot.open()
        assert robot.drive(Command(GO, robot.now())).twist == GO
        came = []
        decided_s = robot.now()
        with robot._lock:
            hung = threading.Thread(target=lambda: came.append(robot.drive(Command(GO, decided_s))))
            hung.start()
            time.sleep(PROFILE.control.robot_timeout_s + 0.1)
        hung.join()
        assert (came[0].twist, came[0].reason) == (STOP, Reason.STALE)


def test_a_process_that_stood_still_knows_how_long_though_all_that_comes_is_of_before():
    with closing(Peer(port := free_port())), closing(Bus("far", connect=f"127.0.0.1:{port}", prefix="")) as bus:
        robot = Ros2Robot(PROFILE, bus, Interface())
        robot.open()
        before_s = robot.now()
        robot._clock.now = lambda _: before_s
        time.sleep(0.3)
        assert robot.now() - before_s > 0.29


def test_other_names_are_used_and_mistaken_ones_refused(capsys):
    with served(Interface(topics={"odom": "/scan"})) as (_, client):
        wait_for(lambda: client.read().scan is not None)
        assert client.read().odom is None  # a scan is no odometry, and is dropped
    with pytest.raises(ConfigError, match="'lidar' is no topic"):
        Interface(topics={"lidar": "scan"})
    words = ["ros2", "--connect", "127.0.0.1:1", "--listen", "127.0.0.1:2"]
    assert main([*words, "--topic", "odom"]) == 2
    assert "names no topic" in capsys.readouterr().err


def test_a_robot_that_does_not_show_what_is_needed_is_refused_with_the_topic(monkeypatch):
    monkeypatch.setattr("lira.robot.ros2.robot.OPEN_S", 1.0)
    port = free_port()
    robot = Peer(port)
    robot.silent.add("scan")
    bus = Bus("lonely", connect=f"127.0.0.1:{port}", prefix="")
    try:
        with pytest.raises(DeviceError, match="nothing comes on 'scan'") as refused:
            Ros2Robot(PROFILE, bus, Interface()).open()
        assert "--topic" in refused.value.remedy
    finally:
        bus.close()
        robot.close()


def test_where_no_bridge_is_that_is_said(monkeypatch):
    monkeypatch.setattr("lira.robot.ros2.robot.OPEN_S", 0.3)
    bus = Bus("lonely", connect=f"127.0.0.1:{free_port()}", prefix="")
    with pytest.raises(BusError, match="no bridge answers"):
        Ros2Robot(PROFILE, bus, Interface()).open()
    assert bus.close()


@pytest.mark.parametrize("datagrams", [False, True])
def test_the_verb_serves_it_for_lira_fusion_and_says_what_is_missing(tmp_path, datagrams):
    far_port, near_port = free_port(), free_port()
    robot = Peer(far_port, datagrams=datagrams, command="TwistStamped" if datagrams else "Twist")
    name, near = f"verb_{near_port}", f"127.0.0.1:{near_port}"
    words = ["ros2", "--connect", f"127.0.0.1:{far_port}", "--name", name, "--listen", near, "--profile", "thesis-sim"]
    words += ["--lidar-yaw", "180", *(["--cmd-vel", "twist_stamped"] if datagrams else [])]
    try:
        with ChildProcess("the server", lira_command(*words), tmp_path / "ros2.log") as server:
            server.wait_ready("serves on", 30.0)
            server.wait_ready("nothing of ours runs on this robot", 10.0)
            if datagrams:
                time.sleep(0.2)
                assert server.output().count("warning:") == 1
            else:
                server.wait_ready("a Twist carries no time", 10.0)
                server.wait_ready("one link to the robot", 10.0)
            policy = ["drive", "lidar-expert", "--name", name, "--connect", near]
            with ChildProcess("the policy", lira_command(*policy), tmp_path / "lira.fusion.log") as fusion:
                fusion.wait_ready("drives", 60.0)
                wait_for(lambda: not robot.commands[-1][1].endswith(ZERO), 20.0)
            wait_for(lambda: robot.commands[-1][1].endswith(ZERO), 2.0)
            assert server.stop() == 0
        assert not re.search("Traceback", server.output())
    finally:
        robot.close()


def scan_of(ranges, start, step):
    return LaserScan(1.0, start, step, 0.1, 12.0, np.array(ranges, np.float32))


def test_a_scan_is_turned_into_the_robots_frame():
    beams = [1.0, 2.0, 3.0, 4.0]  # at -180, -90, 0, 90 degrees of the unit
    quarter = math.pi / 2
    turned = placed_scan(scan_of(beams, -math.pi, quarter), math.pi)
    assert turned.ranges.tolist() == [3.0, 4.0, 1.0, 2.0]
    assert turned.angle_min == pytest.approx(-math.pi)
    turned = placed_scan(scan_of(beams, -math.pi, quarter), quarter)
    assert turned.ranges.tolist() == [4.0, 1.0, 2.0, 3.0]
    clockwise = placed_scan(scan_of(beams, math.pi, -quarter), 0.0)
    assert clockwise.angle_increment == quarter
    assert dict(zip(np.round(np.degrees(clockwise.angle_min + quarter * np.arange(4))) % 360, clockwise.ranges,
                    strict=True)) == {180.0: 1.0, 90.0: 2.0, 0.0: 3.0, 270.0: 4.0}  # fmt: skip
    sector = placed_scan(scan_of(beams, -0.3, 0.2), 0.1)
    assert (sector.angle_min, sector.ranges.tolist()) == (pytest.approx(-0.2), beams)


@pytest.mark.parametrize("yaw", np.linspace(-7.0, 7.0, 15))
def test_whatever_the_mounting_every_beam_keeps_its_bearing_and_runs_from_behind(yaw):
    step = math.tau / 360
    scan = scan_of(np.arange(360), -math.pi, step)
    turned = placed_scan(scan, yaw)
    assert -math.pi - 1e-6 <= turned.angle_min < -math.pi + step + 1e-6
    bearings = turned.angle_min + step * np.arange(360)
    wanted = -math.pi + step * turned.ranges + yaw
    assert np.abs(np.angle(np.exp(1j * (bearings - wanted)))).max() < 1e-4


def test_a_picture_is_named_by_its_bytes():
    assert plain_picture(CompressedImage(1.0, b"\xff\xd8\xff", "rgb8; jpeg compressed bgr8")).format == "jpeg"
    assert plain_picture(CompressedImage(1.0, b"\x89PNG\r\n", "bgr8; png compressed bgr8")).format == "png"
