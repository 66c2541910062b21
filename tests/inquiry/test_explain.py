"""Why a robot did what it did, from a recording: the voice's words, the line, the command, the picture."""

import json

import cv2
import numpy as np
import pytest
from recorded_run import write_reports
from wiring import PROFILE, served

from lira.hal.messages import (
    Applied,
    CompressedImage,
    Decision,
    LaserScan,
    MethodCalls,
    Reason,
    Source,
    Twist,
)
from lira.hal.testing import NullRobot
from lira.tools.cli import main

STOPS_S = 5.0


def drive_of(reports):
    """Add what the wheels got on each decision, until the governor stops them, and what was seen."""
    picture = cv2.imencode(".png", np.full((4, 4), 99, np.uint8))[1].tobytes()
    scan = LaserScan(0.4, -1.0, 0.5, 0.1, 4.0, np.array([1.0, 2.0, np.inf, 0.5, 3.0], np.float32))
    found = [scan, CompressedImage(0.4, picture, "png")]
    for report in reports:
        if isinstance(report, Decision):
            runs = report.stamp_s < STOPS_S
            twist = Twist(0.9, 0.1) if runs else Twist(0.0, 0.0)
            reason, clamps = (Reason.OK, ("linear",)) if runs else (Reason.STALE, ("no_lidar",))
            found.append(Applied(twist, report.stamp_s, Source.POLICY, reason, clamps, report.observation, 0.05, 1, 7))
        found.append(report)
    return found


@pytest.fixture(scope="module")
def recorded(plus, tmp_path_factory):
    profile, reports = plus
    until = [report for report in reports if isinstance(report, MethodCalls | Decision) and report.stamp_s < 9.0]
    return write_reports(tmp_path_factory.mktemp("run") / "rec", profile, drive_of(until)), until


def explained(capsys, *words):
    assert main(["explain", *map(str, words)]) == 0
    return capsys.readouterr().out


def test_the_last_call_is_explained_with_all_that_led_to_it(recorded, tmp_path, capsys):
    folder, reports = recorded
    risen, call = [], "none"
    for report in reports:
        if isinstance(report, Decision):
            risen += [report] if report.call not in ("none", call) else []
            call = report.call
    out = explained(capsys, folder, "--last-call", "--json", tmp_path / "why.json")
    found = json.loads((tmp_path / "why.json").read_text())
    decision = risen[-1]
    assert found["decision"]["observation"] == found["applied"]["answers"] == decision.observation
    assert found["proposed"]["choice"]["call"] == decision.call
    assert found["method"] == "plus"
    assert found["novice"]["labels"] > 0
    assert "of Algorithm 1" in out or "pre-fill" in out
    assert "training lap 1, method 'plus'" in out
    for word in ("because", "drove", "camera", "lidar", "novice", "human", "call", "learned", "wheels"):
        assert f"\n{word} " in out


def test_the_last_stop_says_which_device_was_lost_and_what_came_before(recorded, capsys):
    folder, _ = recorded
    out = explained(capsys, folder, "--last-stop")
    assert f"at {STOPS_S:.1f} s" in out
    assert "STANDS: Lost: lidar." in out
    assert "+0.00 m/s, +0.00 rad/s from policy: stale; cut by no_lidar" in out
    assert "0.2 s before they had +0.90 m/s" in out


def test_a_moment_comes_with_its_picture_and_its_scan(recorded, tmp_path, capsys):
    folder, _ = recorded
    out = explained(capsys, folder, "--at", "0.6", "--out", tmp_path / "why")
    assert "by command 7 of its sender, 0.05 s old" in out
    assert "cut by linear" in out
    assert cv2.imread(str(tmp_path / "why" / "picture.png")).shape[:2] == (4, 4)
    assert len((tmp_path / "why" / "scan.csv").read_text().splitlines()) == 6
    drawing = (tmp_path / "why" / "scan.svg").read_text()
    assert drawing.count("h0") == 4 + 1  # beams that saw something, and the robot


@pytest.mark.parametrize(("words", "said"), [(["--at", "700"], "nothing was recorded 700.0 s after"), ([], "")])
def test_a_time_that_is_none_of_the_recording_is_refused(recorded, capsys, words, said):
    status = main(["explain", str(recorded[0]), *words])
    assert status == (2 if said else 0)
    assert said in capsys.readouterr().err


def test_a_robot_that_never_stopped_and_nobody_who_was_called_are_said(plus, tmp_path, capsys):
    profile, _ = plus
    folder = write_reports(tmp_path / "rec", profile, [Applied(Twist(1.0, 0.0), 0.2, Source.POLICY, Reason.OK)])
    assert main(["explain", str(folder), "--last-stop"]) == 2
    assert "never stopped" in capsys.readouterr().err
    assert main(["explain", str(folder), "--last-call"]) == 2
    assert "nobody was called" in capsys.readouterr().err
    assert "nobody decides" in explained(capsys, folder, "--at", "0.3")


def test_now_has_no_times(capsys):
    assert main(["explain", "--last-stop"]) == 2
    assert "times and labels are those of a recording" in capsys.readouterr().err


def test_a_robot_in_lockstep_that_nobody_drives_waits_for_a_driver_and_is_not_out_of_reach(capsys):
    with served(NullRobot(PROFILE), lockstep=True) as robot:
        out = explained(capsys, "--connect", robot.endpoint, "--name", robot.name)
    assert "WAITS FOR A DRIVER: It is in lockstep" in out
    assert "senses    nothing" not in out
