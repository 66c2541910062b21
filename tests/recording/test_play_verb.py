"""`lira play`: a recording as a robot on the bus, and as what was told."""

import uuid

import pytest
from samples import HEAD, drive, write
from test_record_verb import wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import SCAN
from lira.hal.client.connect import connect
from lira.hal.messages import STOP, Command, Reason, Twist
from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

READY_S = 60.0
SECONDS = 20


@pytest.fixture
def address():
    return f"play_{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}"


def played(folder, address, *words):
    write(folder / "rec", drive(SECONDS), aligned=True)
    command = lira_command("play", str(folder / "rec"), *words, "--name", address[0], "--listen", address[1])
    return ChildProcess("the player", command, folder / "play.log")


def test_as_a_robot_it_shows_what_was_seen_and_takes_commands_until_it_is_over(tmp_path, address):
    with played(tmp_path, address, "--robot") as process:
        process.wait_ready("recorded robot", READY_S)
        with connect(address[1], address[0]) as robot:
            assert robot.profile == HEAD.info.profile
            assert robot.arena is None  # nobody recorded the truth
            wait_for(lambda: robot.read().scan is not None)
            assert robot.read().scan.ranges[0] == 1.5

            def drives():
                robot.drive(Command(STOP, robot.now(), answers=robot.read().seq))
                robot.drive(Command(Twist(0.1, 0.0), robot.now(), answers=robot.read().seq))
                robot.wait(robot.now() + 0.1)
                applied = robot.drive(Command(Twist(0.1, 0.0), robot.now(), answers=robot.read().seq))
                return applied.reason is Reason.OK and applied.twist.linear_m_s > 0.0

            wait_for(drives)
        assert process.wait(SECONDS + 20.0) == 0
        assert "the recording is over" in process.output()


def test_as_it_was_who_watches_hears_it(tmp_path, address):
    with played(tmp_path, address, "--speed", "2") as process:
        process.wait_ready("plays", READY_S)
        watch = Bus(address[0], connect=address[1], watch=True)
        try:
            reader = watch.reader(SCAN)
            wait_for(lambda: reader.newest() is not None)
        finally:
            watch.close()


@pytest.mark.parametrize("words", [["--robot", "--step"], ["--robot", "--from", "3"]])
def test_what_does_not_go_together_is_refused(tmp_path, capsys, words):
    assert main(["play", str(tmp_path), *words]) == 2
    assert "a robot's time is its own" in capsys.readouterr().err
