"""The arithmetic of `lira parity` on made-up recordings, and two robots under the script over a real bus."""

import json
import math
import threading
import uuid
from contextlib import contextmanager

import cv2
import numpy as np
import pytest

from lira.hal.bus.bus import Bus
from lira.hal.errors import BusError
from lira.hal.messages import Applied, Command, CompressedImage, Imu, LaserScan, Odometry, Reason, Source, Twist
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.sim_backend.twin import Twin
from lira.tools import cli
from lira.tools.launch.processes import free_port
from lira.tools.parity import motion, script
from lira.tools.parity.compare import DIFFERS, MISSING, SAME, compare
from lira.tools.parity.page import render
from lira.tools.parity.record import Heard, InterruptedScriptError, Recording, Span, record
from lira.tools.parity.script import motions
from lira.tools.parity.sight import match_scans
from lira.tools.verbs.robots import parity

pytestmark = pytest.mark.slow

PROFILE = load_profile("rosbot2")
WALLS = (3.0, -1.5, 2.0, -1.2)  # of a room, seen from the robot: ahead, behind, left, right


def room(bearing):
    """Distance to the walls of a room that looks different from every side."""
    cos, sin = math.cos(bearing), math.sin(bearing)
    ahead, behind, left, right = WALLS
    x = (ahead if cos > 0 else behind) / cos if abs(cos) > 1e-9 else math.inf
    y = (left if sin > 0 else right) / sin if abs(sin) > 1e-9 else math.inf
    return min(x, y)


def scan_at(stamp_s, seen=room):
    increment = math.tau / 400
    ranges = np.array([seen(-math.pi + increment * k) for k in range(400)], np.float32)
    return LaserScan(stamp_s, -math.pi, increment, 0.15, 12.0, ranges)


def made_up(*, speed=1.0, lag_s=0.02, seen=room, gray=120, odom_hz=20.0):
    """A recording of an ideal robot that follows the script `lag_s` late and `speed` times as fast as told."""
    recording, at_s = Recording("made up", PROFILE), 100.0
    for phase in motions(PROFILE.base):
        recording.spans.append(Span(phase, at_s, at_s + phase.duration_s))
        at_s += phase.duration_s
    began_s = recording.spans[0].began_s

    def told(time_s):
        return next((s.phase.twist for s in recording.spans if s.began_s <= time_s < s.ended_s), Twist(0.0, 0.0))

    x_m = yaw_rad = 0.0
    for tick in range(round((at_s - began_s) * 100)):
        now_s = began_s + tick * 0.01
        twist = told(now_s - lag_s)
        linear, angular = speed * twist.linear_m_s, speed * twist.angular_rad_s
        x_m, yaw_rad = x_m + 0.01 * linear, yaw_rad + 0.01 * angular
        if tick % round(100 / odom_hz) == 0:
            odom = Odometry(now_s, x_m, 0.0, math.remainder(yaw_rad, math.tau), linear, angular)
            recording.odom.append(Heard(odom, now_s + 0.01))
            applied = Applied(twist, now_s, Source.POLICY, Reason.OK)
            recording.applied.append(Heard(applied, now_s + lag_s))
        if tick % 10 == 0:
            recording.imu.append(Heard(Imu(now_s, yaw_rad, angular, 0.0, 0.0), now_s))
        if tick % 10 == 0 and now_s < recording.spans[1].began_s:
            recording.scan.append(Heard(scan_at(now_s, seen), now_s + 0.05))
            picture = cv2.imencode(".png", np.full((64, 64), gray, np.uint8))[1].tobytes()
            recording.image.append(Heard(CompressedImage(now_s, picture, "png"), now_s + 0.03))
    return recording


def verdicts(first, second):
    return {row.name: row.verdict for row in compare(first, second)}


def differing(first, second):
    return {name for name, verdict in verdicts(first, second).items() if verdict == DIFFERS}


@pytest.fixture(scope="module")
def ideal():
    return made_up()


def test_a_robot_is_like_itself(ideal):
    assert set(verdicts(ideal, ideal).values()) == {SAME}


def test_step_responses_are_what_was_made_up(ideal):
    late = made_up(lag_s=0.3)
    assert motion.settled(ideal, "ahead") == pytest.approx(0.1)
    assert motion.way(ideal, "ahead") == pytest.approx(0.2, abs=0.005)
    assert motion.way(ideal, "left") == pytest.approx(1.6, abs=0.05)
    assert motion.halt_way(late, "ahead") == pytest.approx(0.3 * 0.1, abs=0.006)
    assert motion.delay_s(late, "ahead") - motion.delay_s(ideal, "ahead") == pytest.approx(0.28, abs=0.06)
    assert motion.halt_s(late, "left") == pytest.approx(0.3, abs=0.06)
    assert motion.turned_by_imu(ideal, "right") == pytest.approx(motion.settled(ideal, "right"))


def test_wheels_that_go_a_fifth_too_fast_are_seen_and_nothing_else(ideal):
    assert differing(ideal, made_up(speed=1.2)) == {
        *("ahead: speed", "back: speed", "left: turn rate", "left: turn rate by the IMU", "left: turn"),
        "right: turn rate",
    }


def test_a_late_base_is_seen(ideal):
    found = differing(ideal, made_up(lag_s=0.3))
    assert {"command to its echo", "ahead: until it moves", "ahead: time to stop", "left: until it turns"} <= found
    assert "ahead: speed" not in found


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda bearing: room(-bearing), "mirrored"),
        (lambda bearing: room(bearing + math.pi), "turned by +180 deg"),
        (lambda bearing: room(bearing - math.radians(30.0)), "turned by -30 deg"),
    ],
)
def test_a_lidar_that_is_mounted_wrongly_is_seen_and_named(ideal, wrong, words):
    rows = {row.name: row for row in compare(ideal, made_up(seen=wrong))}
    row = rows["scans from one place: beams apart"]
    assert (row.verdict, row.note) == (DIFFERS, f"the second scan fits better {words}")
    assert rows["lidar: beams that say something"].verdict == SAME


def test_a_robot_in_another_place_is_seen_but_not_called_mirrored(ideal):
    elsewhere = match_scans(ideal, made_up(seen=lambda bearing: 0.5 * room(bearing) + 1.0))
    assert elsewhere.apart > 0.3
    assert elsewhere.fit == "as it is"


def test_a_blind_lidar_and_a_darker_picture_are_seen(ideal):
    blind = made_up(seen=lambda bearing: math.nan if abs(bearing) > 2.0 else room(bearing), gray=60)
    assert differing(ideal, blind) == {
        *("lidar: beams that say something", "camera: brightness, of 255", "pictures from one place, of 255"),
    }


def test_slow_odometry_is_seen_and_a_missing_sensor_is_left_open(ideal):
    slow = made_up(odom_hz=10.0)
    slow.imu.clear()
    slow.image.clear()
    found = verdicts(ideal, slow)
    assert found["odometry: rate"] == DIFFERS
    assert found["IMU: rate"] == found["camera: rate"] == found["pictures from one place, of 255"] == MISSING


def test_the_page_shows_both_and_loads_nothing(ideal):
    other = made_up(speed=1.2)
    text = render(ideal, other, compare(ideal, other))
    assert text.count("<svg") == 6
    assert "6 of" in text
    assert "http" not in text.replace("http-equiv", "")
    assert "<script" not in text


@contextmanager
def on_the_bus():
    """Serve a twin in real time in the room; yields a client's bus."""
    twin = Twin(load_profile("thesis-sim"), "room", realtime_factor=1.0, renderer="sketch")
    name, endpoint, stop = f"p{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}", threading.Event()
    robot_bus, bus = Bus(name, listen=endpoint), Bus(name, connect=endpoint)
    server = threading.Thread(target=HalServer(GovernedRobot(twin), robot_bus, twin).run, args=[stop])
    server.start()
    try:
        yield bus
    finally:
        stop.set()
        server.join(10.0)
        assert bus.close()
        assert robot_bus.close()


def test_somebody_else_at_the_wheel_is_an_error():
    with on_the_bus() as bus:
        other, stop = Bus(bus.robot, connect=bus.endpoint), threading.Event()

        def drive():
            from lira.hal.client.connect import open_remote

            robot = open_remote(other)
            while not stop.is_set():
                robot.drive(Command(Twist(0.0, 0.0), robot.now()))
                robot.wait(robot.now() + 0.05)
            robot.close()

        rival = threading.Thread(target=drive)
        rival.start()
        try:
            stop.wait(1.0)
            with pytest.raises(BusError, match="driven by somebody else"):
                record(bus, "contested")
        finally:
            stop.set()
            rival.join(10.0)
            assert other.close()


@pytest.mark.parametrize(("stops", "driven"), [(0, 1), (2, 3), (3, 3)])
def test_own_robots_are_driven_anew_where_the_machine_was_too_busy(tmp_path, monkeypatch, stops, driven):
    calls = []

    def over_bus(*words):
        calls.append(words)
        if len(calls) <= stops:
            raise InterruptedScriptError("'twin' did not do 'left' to the end", "Wait.")
        return "recording"

    monkeypatch.setattr(parity, "over_bus", over_bus)
    if stops < parity.ATTEMPTS:
        assert parity.started([], tmp_path, "a", "b", "twin") == "recording"
    else:
        with pytest.raises(InterruptedScriptError):
            parity.started([], tmp_path, "a", "b", "twin")
    assert len(calls) == driven


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["rosbot"], "'rosbot' names no robot"),
        (["a@127.0.0.1:7447"], "parity compares two robots, not 1"),
        (["--world", "nosuch"], "unknown world 'nosuch'"),
        (["--profile", "nosuch"], "unknown profile 'nosuch'"),
    ],
)
def test_wrong_words_are_refused_at_once(words, complaint, capsys):
    assert cli.main(["parity", *words]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith(f"lira parity: {complaint}")
    assert len(lines) == 2


def test_the_twin_and_its_wire_behave_alike(tmp_path, capsys, monkeypatch):
    for name, value in {"STAND_S": 1.5, "STEP_S": 1.2, "REST_S": 0.9, "REACH_M": 0.48}.items():
        monkeypatch.setattr(script, name, value)  # half the time, as fast
    monkeypatch.setattr(parity, "ATTEMPTS", 6)  # a busy machine lets a robot stand now and then
    out = tmp_path / "out"
    settings = tmp_path / "mine.toml"
    settings.write_text("[base]\ndistance_scale = 1.2\n")
    words = ["parity", "--profile", "thesis-sim", "--settings", str(settings), "--out", str(out)]
    assert cli.main([*words, "--json", str(tmp_path / "parity.json")]) == 1
    table = json.loads((tmp_path / "parity.json").read_text())
    assert "ahead: stopping distance" in capsys.readouterr().out
    rows = {row["name"]: row for row in table["rows"]}
    assert [robot["name"] for robot in table["robots"]] == ["twin", "wire"]
    # What the settings falsify is seen; the rest is within what is allowed.
    assert rows["ahead: speed"]["second"] == pytest.approx(0.48, abs=0.01)
    assert rows["ahead: speed"]["verdict"] == DIFFERS
    for name in ("left: turn rate", "lidar: rate", "scans from one place: median", "pictures from one place, of 255"):
        assert rows[name]["verdict"] == SAME, rows[name]
    for name in ("left: until it turns", "left: rise, 10 to 90 %"):
        assert abs(rows[name]["difference"]) < 0.3, rows[name]
    assert (out / "parity.html").exists()
